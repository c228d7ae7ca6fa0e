"""Plots of the report as SVG elements in the colours of the page."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from html import escape
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array
from loco_drake.evaluation.generation_pictures import (
    CONFUSIONS,
    draw_confusions,
    draw_strip,
)
from loco_drake.evaluation.report.content import CONTENT
from loco_drake.evaluation.report.results import Figures
from loco_drake.evaluation.report.tables import robot_title
from loco_drake.evaluation.robustness_pictures import curves_figure
from loco_drake.evaluation.steering_grid import draw_grid, grid_errors
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS, SOURCES
from loco_drake.motion.motion import Motion

# Readable on white and on near-black, and by the colour-blind.
COLORS = dict(zip(SOURCES, ("#d9730d", "#2e86c9", "#1f9d6b", "#b5569b"), strict=True))
ROBOT_COLORS = {"go2": "#2e86c9", "a1": "#d9730d"}

# Stands for the colour of the page's text until the SVG is written.
INK = "#010203"
FAINT = "#808890"

_TALL = 15.0  # of 100: bars that a number fits into
# Lines among the returns: the goals that they are of.
_AIMS = {
    "aim, mean": "normalized return, mean of all gaits",
    "aim, worst gait": "normalized return, worst gait",
}
_STYLE: dict[str, Any] = {
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "font.family": "sans-serif",
    "font.size": 10,
    "grid.color": FAINT,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "loco_drake",
    "text.color": INK,
    "xtick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.color": FAINT,
    "ytick.labelcolor": INK,
}
_P = ParamSpec("_P")


def _as_svg(draw: Callable[_P, tuple[Figure, str]]) -> Callable[_P, str]:
    """Makes an SVG element of a figure, in the page's style, and what it shows."""

    @wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> str:
        buffer = io.StringIO()
        with mpl.rc_context(_STYLE):  # type: ignore[arg-type, unused-ignore]
            figure, alt = draw(*args, **kwargs)
            figure.savefig(buffer, format="svg", metadata={"Date": None})
        text = buffer.getvalue()
        text = text[text.index("<svg") :].replace(INK, "currentColor")
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        return text.replace("<svg ", f'<svg role="img" aria-label="{escape(alt)}" ', 1)

    return drawn


@_as_svg
def gaits_picture(motions: Mapping[str, Sequence[Motion]]) -> tuple[Figure, str]:
    """Returns the outlines of robots in each gait, a row each (Figure 1).

    All robots have one motion for each of the same labels, in the same order.
    """
    robots = list(motions)
    count = len(motions[robots[0]])
    figure = Figure(figsize=(11, 0.6 * count + 0.3), layout="constrained")
    axes = figure.subplots(count, len(robots), squeeze=False)
    for column, name in enumerate(robots):
        axes[0, column].set_title(robot_title(name))
        for row, motion in enumerate(motions[name]):
            color = COLORS[motion.source]
            cell = axes[row, column]
            draw_strip(cell, get_robot(name), motion, near=(color, color), ink=INK)
            cell.set_ylim(-0.03, 0.43)
            if column == 0:
                style = {"ha": "right", "color": color, "weight": "bold"}
                where = {"transform": cell.transAxes}
                cell.text(-0.01, 0.4, str(motion.label), **where, **style)
    sources = ", ".join(dict.fromkeys(m.source for m in motions[robots[0]]))
    return figure, (
        f"Outlines of {' and '.join(robots)} every tenth of a second in "
        f"{count} generated gaits, from {sources}."
    )


@_as_svg
def learning_picture(curves: Mapping[str, Figures]) -> tuple[Figure, str]:
    """Returns how returns grew in training, by source (Figure 3).

    The figures of each robot are those with "learning".
    """
    figure = Figure(figsize=(5.5 * len(curves), 3.8), layout="constrained")
    axes = figure.subplots(1, len(curves), squeeze=False, sharey=True)[0]
    ends = []
    for cell, (robot, figures) in zip(axes, curves.items(), strict=True):
        steps, by_source = _curves(figures)
        for source, returns in by_source.items():
            for values in returns:
                cell.plot(steps, values, color=COLORS[source], lw=0.8, alpha=0.35)
            # Of the labels already trained on.
            mean = np.ma.masked_invalid(returns).mean(axis=0).filled(np.nan)
            cell.plot(steps, mean, color=COLORS[source], lw=2.2, label=source)
            ends.append(f"{robot} {source} {mean[-1]:.0f}")
        cell.axhline(100, color=FAINT, ls="--", lw=1)
        cell.text(0, 101.5, "most that can be had", color=FAINT, size=8)
        cell.set(xlabel="million steps of 20 ms", ylim=(0, 108), xlim=(0, None))
        cell.set_title(robot_title(robot))
        cell.grid(visible=True)
        cell.legend(loc="lower right", ncols=2)
    axes[0].set_ylabel("normalized return in training, of 100")
    return figure, (
        "Learning curves: mean normalized return of each source's gaits against "
        f"millions of steps; at the end {', '.join(ends)}."
    )


def _curves(figures: Figures) -> tuple[Array, dict[str, Array]]:
    """Returns steps in millions, (N,), and returns by source, (labels, N)."""
    steps = np.array(figures.numbers("learning", "steps"), float) / 1e6
    by_source: dict[str, list[Array]] = {source: [] for source in SOURCES}
    for label in figures.part("learning", "return").values:
        values = np.array(figures.numbers("learning", "return", label), float)
        source = label.split("-")[0]
        if source not in by_source or len(values) != len(steps):
            raise figures.damaged(f"learning.return.{label} is no curve of a gait")
        by_source[source].append(values)
    return steps, {name: np.array(found) for name, found in by_source.items() if found}


@_as_svg
def returns_picture(tracking: Mapping[str, Figures]) -> tuple[Figure, str]:
    """Returns the return of each gait, robot beside robot."""
    labels = [str(label) for label in LABELS]
    figure = Figure(figsize=(11, 3.9), layout="constrained")
    axes = figure.add_subplot()
    width = 0.8 / len(tracking)
    for place, (robot, figures) in enumerate(tracking.items()):
        found = dict(figures.parts("labels"))
        for x, label in enumerate(labels):
            part = found.get(label)
            if part is None or (value := part.required("normalized_return")) is None:
                continue
            at = x + (place - (len(tracking) - 1) / 2) * width
            axes.bar(at, value, 0.9 * width, color=ROBOT_COLORS[robot])
            worst = part.number("normalized_return_worst")
            if worst is not None:
                axes.plot([at], [worst], "_", color=INK, ms=9, mew=2)
            height, color = (2, "white") if value > _TALL else (value + 1, INK)
            text = f"{value:.0f}"
            axes.text(at, height, text, ha="center", size=8, color=color)
        name = robot_title(robot)
        axes.bar([np.nan], [np.nan], color=ROBOT_COLORS[robot], label=name)
    axes.plot([], [], "_", color=INK, ms=9, mew=2, label="worst episode")
    goals = {goal.title: goal for own in CONTENT.goals.values() for goal in own}
    for what, title in _AIMS.items():
        aim = goals[title].aim.least
        axes.axhline(aim, color=FAINT, ls="--", lw=1, zorder=0)
        axes.text(len(labels) - 0.45, aim, what, va="bottom", color=FAINT, size=8)
    axes.set_xticks(range(len(labels)), labels, rotation=35, ha="right")
    axes.set(ylim=(0, 105), xlim=(-0.6, len(labels) + 0.9))
    axes.set_ylabel("normalized return, of 100")
    figure.legend(loc="outside upper right", ncols=3)
    return figure, "Normalized return of each gait; the table has the values."


@_as_svg
def grid_picture(figures: Figures) -> tuple[Figure, str]:
    """Returns how far a steered robot is off each command of the grid, by gait."""
    errors = grid_errors(figures)
    figure = Figure(figsize=(11, 2.4 + 0.5 * len(errors)), layout="constrained")
    draw_grid(figure, errors, ink=INK)
    return figure, (
        f"How far velocity and yaw rate are off the command at each point of the grid, "
        f"for {len(errors)} gaits; the tables have the errors of all points together."
    )


@_as_svg
def curves_picture(robots: Mapping[str, Figures]) -> tuple[Figure, str]:
    """Returns how often disturbed robots succeed, against the size of each kind."""
    return curves_figure(robots, ink=INK), (
        f"Success of {' and '.join(robots)} against the size of each kind of "
        "disturbance; the tables have the means."
    )


@_as_svg
def confusion_picture(figures: Figures, kind: str) -> tuple[Figure, str]:
    """Returns what gaits were taken for by a kind of classifier, as three matrices."""
    labels = figures.part("confusion").values.get("labels")
    known = [str(label) for label in LABELS]
    if not isinstance(labels, list) or labels != [k for k in known if k in labels]:
        raise figures.damaged("confusion.labels are no gaits")
    within = figures.part("confusion", kind)
    matrices = {
        title: within.matrix(key, len(labels)) for key, title in CONFUSIONS.items()
    }
    figure = Figure(figsize=(11, 4.7), layout="constrained")
    draw_confusions(figure, matrices, labels)
    return figure, (
        f"Confusion matrices of the {kind} classifier over {len(labels)} gaits: "
        "what each gait, a row, was taken for."
    )
