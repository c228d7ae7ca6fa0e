"""How far a steered robot is off its commands, over the grid, as a map."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array, Bools
from loco_drake.control.command import AXES
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.steering_courses import VELOCITY_GOAL, YAW_RATE_GOAL
from loco_drake.motion.gaits import LABELS

_MIDDLE = 0.5
_INNER = (0.0, 0.25, 0.75, 1.0)
# Columns of the map: where in its range each axis of the command is, from 0 to 1.
COLUMNS = np.array(
    [
        [_MIDDLE] * 3,
        *(np.where(np.arange(3) == a, s, _MIDDLE) for a in range(3) for s in _INNER),
        *itertools.product((0.0, 1.0), repeat=3),
    ]
)
_GROUPS = {
    "middle": (0, 1),
    "forward": (1, 5),
    "sideways": (5, 9),
    "turning": (9, 13),
    "corners": (13, 21),
}
# The lowest and the highest value of each axis.
_ENDS = ("↓↑", "→←", "↻↺")
_SIGNS = (
    "↓ slowest, ↑ fastest; → right, ← left; ↻ clockwise, ↺ counterclockwise; "
    "¼, ¾ of the way from one end of the range to the other"
)
# Dark to bright, told apart by the colour-blind; its ends leave text readable.
_COLORS = "cividis"
_FELL = "#d55e00"


@dataclass(frozen=True)
class GridErrors:
    """Errors of a label at each of COLUMNS, NaN where the grid has no point."""

    velocity: Array  # distance of the mean velocity from the command, m/s
    yaw_rate: Array  # the same of the yaw rate, rad/s
    fell: Bools  # whether the robot fell


def grid_errors(figures: Figures) -> dict[str, GridErrors]:
    """Returns the errors by label, in the labels' order, from steering results.

    Raises:
        InputError: if a result is damaged.
    """
    found = dict(figures.parts("labels"))
    return {
        label: _of_label(found[label]) for label in map(str, LABELS) if label in found
    }


def _of_label(figures: Figures) -> GridErrors:
    low, high = _range(figures.part("range"))
    wide = high > low
    width = np.where(wide, high - low, 1.0)
    velocity, yaw_rate = np.full((2, len(COLUMNS)), np.nan)
    fell = np.zeros(len(COLUMNS), bool)
    for point in figures.objects("points"):
        command, mean = point.vector("command", 3), point.vector("velocity", 3)
        if command is None:
            raise point.damaged("a point has no command")
        at = _columns((command - low) / width, wide)
        fell[at] = point.flag("fell")
        if mean is not None:
            velocity[at] = np.hypot(*(mean - command)[:2])
            yaw_rate[at] = abs(mean[2] - command[2])
    return GridErrors(velocity, yaw_rate, fell)


def _range(figures: Figures) -> tuple[Array, Array]:
    """Returns lowest and highest command, shape (3,) each."""
    ends = [figures.vector(axis, 2) for axis in AXES]
    known = [end for end in ends if end is not None]
    if len(known) < len(ends):
        raise figures.damaged("a range has no ends")
    low, high = np.array(known).T
    return low, high


def _columns(share: Array, wide: Bools) -> Bools:
    """Returns which columns show a point; of axes without width, all corners do.

    ``share`` is where in its range each axis is, ``wide`` whether that has a width.
    """
    same = np.abs(share - COLUMNS) < 0.01
    off = COLUMNS != _MIDDLE
    found: Bools = (same | ~wide).all(axis=1) & (
        (wide | ~off).all(axis=1) | off.all(axis=1)
    )
    return found


def draw_grid(
    figure: Figure, errors: Mapping[str, GridErrors], *, ink: str = "k"
) -> None:
    """Draws errors by label in an empty figure; ``ink`` is the colour of its text.

    A row is a label, a column a point of the grid.
    """
    upper, lower = figure.subplots(2, 1, sharex=True)
    velocities = np.array([e.velocity for e in errors.values()])
    yaw_rates = np.array([e.yaw_rate for e in errors.values()])
    fell = np.array([e.fell for e in errors.values()])
    _draw(upper, velocities, fell, VELOCITY_GOAL, list(errors), ink)
    _draw(lower, yaw_rates, fell, YAW_RATE_GOAL, list(errors), ink)
    titles = (
        f"velocity off the command, m/s; bold beyond {_short(VELOCITY_GOAL)}",
        f"yaw rate off the command, rad/s; bold beyond {_short(YAW_RATE_GOAL)}",
    )
    upper.set_title(titles[0], size=10, loc="left", pad=18)
    lower.set_title(titles[1], size=10, loc="left")
    for name, (first, last) in _GROUPS.items():
        middle = (first + last - 1) / 2
        upper.text(middle, -0.6, name, ha="center", va="bottom", size=8, color=ink)
    lower.set_xticks(range(len(COLUMNS)), _column_titles(), size=8)
    lower.set_xlabel(_SIGNS, size=8)


def _draw(
    axes: Axes, values: Array, fell: Bools, goal: float, labels: list[str], ink: str
) -> None:
    rows, columns = values.shape
    edges = np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5
    known = np.ma.masked_where(fell, np.ma.masked_invalid(values))
    axes.pcolormesh(*edges, known, cmap=_COLORS, vmin=0.0, vmax=2 * goal)
    fallen = np.ma.masked_where(~fell, np.ones_like(values))
    axes.pcolormesh(*edges, fallen, cmap=ListedColormap([_FELL]))
    for (row, column), value in np.ndenumerate(values):
        style: dict[str, Any] = {"ha": "center", "va": "center", "size": 7}
        if fell[row, column]:
            axes.text(column, row, "fell", color="white", **style)
        elif value <= goal:
            axes.text(column, row, _short(value), color="white", **style)
        elif value > goal:
            text = _short(value)
            axes.text(column, row, text, color="black", weight="bold", **style)
    axes.set_yticks(range(rows), labels, size=8)
    axes.tick_params(length=0)
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    for _, last in list(_GROUPS.values())[:-1]:
        axes.axvline(last - 0.5, color=ink, lw=1)


def _short(value: float) -> str:
    return f"{value:.2f}".removeprefix("0")


def _column_titles() -> list[str]:
    titles = []
    for shares in COLUMNS:
        ends = [e[int(s)] for e, s in zip(_ENDS, shares, strict=True) if s in (0, 1)]
        quarter = {0.25: "¼", 0.75: "¾"}
        titles += ["\n".join(ends) or "".join(quarter.get(s, "") for s in shares)]
    return titles
