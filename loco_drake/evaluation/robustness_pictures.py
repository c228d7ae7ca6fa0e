"""The success curves of ``evaluate robustness`` as a picture and as a table."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from loco_drake.evaluation.confidence import wilson
from loco_drake.evaluation.disturbances import KINDS, Kind
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.robustness import SHARE

# Told apart by the colour-blind.
_COLORS = ("#0072b2", "#d55e00", "#009e73", "#b5569b")


def levels_table(whole: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Returns columns and rows of the success of all labels at each level."""
    rows = []
    for name, curve in whole["curves"].items():
        kind = KINDS[name.split("_")[0]]
        shares = zip(curve["levels"], curve["success"], strict=True)
        found = _level(kind, curve["level_80_percent"])
        low, high = (_level(kind, v) for v in curve["level_80_percent_interval"])
        beyond = " or worse" if curve["level_80_percent_beyond"] else ""
        rows.append(
            [
                _title(name),
                ", ".join(f"{_level(kind, v)}: {100 * s:.0f}" for v, s in shares),
                f"{found}{beyond} [{low}, {high}]",
            ]
        )
    return ["disturbance", "level: success, %", "80 % at, 95 % interval"], rows


def curves_figure(robots: Mapping[str, Figures], *, ink: str = "k") -> Figure:
    """Returns success against the level of each kind, of all labels together.

    ``robots`` are the figures of each robot; ``ink`` is the colour of the text. Bars
    are Wilson's 95 % intervals of the shares.
    """
    found = {robot: own.part("all", "curves") for robot, own in robots.items()}
    kinds = [
        kind for kind in KINDS if any(kind in own.values for own in found.values())
    ]
    figure = Figure(figsize=(11, 2.9 * -(-len(kinds) // 3)), layout="constrained")
    grid = figure.subplots(-(-len(kinds) // 3), 3, squeeze=False, sharey=True)
    cells = list(grid.flat)
    for axes, kind in zip(cells, kinds, strict=False):
        for place, (robot, own) in enumerate(found.items()):
            if kind in own.values:
                _draw(axes, kind, own, robot, place)
        axes.axhline(100 * SHARE, color=ink, ls=":", lw=0.8)
        axes.grid(visible=True, alpha=0.3)
    for axes in cells[len(kinds) :]:
        axes.set_axis_off()
    return figure


def _draw(axes: Axes, name: str, curves: Figures, robot: str, place: int) -> None:
    kind = KINDS[name]
    ways = [f"{name}_{way}" for way in kind.ways if way] or [name]
    width = kind.factor * abs(kind.levels[-1] - kind.nominal)
    for k, way in enumerate(ways):
        color = _COLORS[k if len(ways) > 1 else place]
        aside = 0.012 * width * (k + place - (len(ways) - 1) / 2)  # of the bars
        part = curves.part(way)
        levels, shares, counts = (
            np.array(part.numbers(key), float)
            for key in ("levels", "success", "episodes")
        )
        sound = len(levels) == len(shares) == len(counts) and counts.min() > 0
        if not (sound and shares.min() >= 0 and shares.max() <= 1):
            raise curves.damaged(f"{way} is no curve")
        low, high = np.transpose(
            [wilson(s, n) for s, n in zip(shares, counts, strict=True)]
        )
        axes.errorbar(
            kind.factor * levels + aside,
            100 * shares,
            100 * np.abs([shares - low, high - shares]),
            color=color,
            ls=("-", "--")[place % 2],
            marker="o",
            ms=4,
            lw=1.5,
            elinewidth=0.7,
            label=" ".join(filter(None, (robot, way.partition("_")[2]))),
        )
    unit = f", {kind.unit}" if kind.unit else ""
    axes.set(xlabel=f"{kind.title}{unit}", ylim=(-3, 104))
    if (grid_cell := axes.get_subplotspec()) and grid_cell.is_first_col():
        axes.set_ylabel("success, %")
    if kind.levels[-1] < kind.nominal:
        axes.set_xlim(*sorted(axes.get_xlim(), reverse=True))
    # Long enough to show dashes.
    axes.legend(fontsize=7, loc="lower left", handlelength=3.5)


def _title(name: str) -> str:
    kind, _, way = name.partition("_")
    if way.startswith("phase"):
        return f"{kind}, {way.rpartition('_')[2]} % of a stride after FL lands"
    unit = KINDS[kind].unit
    return ", ".join(filter(None, (kind, way, unit)))


def _level(kind: Kind, level: float) -> str:
    return f"{kind.factor * level:.3g}"
