"""A picture of the gait that each command chooses."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from loco_drake.common.arrays import Array, Integers
from loco_drake.control.gait_choice import (
    PAUSE,
    Choice,
    MeasuredGait,
    best_gait,
    next_choice,
)
from loco_drake.motion.gaits import LABELS

# m/s and rad/s.
_FORWARD = np.round(np.arange(-1.0, 3.2001, 0.05), 6)
_TURNING = np.round(np.arange(0.0, 1.2001, 0.05), 6)
# Told apart by the colour-blind, as far as fifteen can be.
_COLORS = [
    "#88ccee",
    "#44aa99",
    "#117733",
    "#999933",
    "#ddcc77",
    "#cc6677",
    "#882255",
    "#aa4499",
    "#332288",
    "#661100",
    "#6699cc",
    "#888888",
    "#e69f00",
    "#bbbbbb",
    "#000000",
]


def choice_map(gaits: Mapping[int, MeasuredGait]) -> Integers:
    """Returns the best gait at each forward velocity and yaw rate, (turning, forward).

    Entries are indices into LABELS. No gait is walked before.
    """
    return np.array(
        [[best_gait(gaits, np.array([v, 0.0, w])) for v in _FORWARD] for w in _TURNING]
    )


def sweep(gaits: Mapping[int, MeasuredGait], speeds: Array) -> Integers:
    """Returns the gait at each of many forward velocities (N,), one after the other.

    There is time for a change at each.
    """
    choice = Choice(best_gait(gaits, np.array([speeds[0], 0.0, 0.0])))
    labels = []
    for k, speed in enumerate(speeds):
        choice = next_choice(gaits, np.array([speed, 0.0, 0.0]), choice, k * PAUSE)
        labels.append(choice.label)
    return np.array(labels)


def choice_figure(robots: Mapping[str, Mapping[int, MeasuredGait]]) -> Figure:
    """Returns the choices of each robot, by name.

    A map shows the best gait by forward velocity and turning; two bars above, the gait
    that is walked while the forward velocity rises and falls.
    """
    figure = Figure(figsize=(11, 1.0 + 2.7 * len(robots)), layout="constrained")
    rows = figure.subplots(2 * len(robots), 1, height_ratios=[1, 3] * len(robots))
    seen: list[int] = []
    for (name, gaits), bars, plane in zip(
        robots.items(), rows[::2], rows[1::2], strict=True
    ):
        up, down = sweep(gaits, _FORWARD), sweep(gaits, _FORWARD[::-1])[::-1]
        chosen = choice_map(gaits)
        _paint(bars, np.array([down, up]), np.array([0.0, 1.0]))
        bars.set_yticks([0, 1], ["slower", "faster"])
        bars.tick_params(bottom=False, labelbottom=False)
        bars.set_title(name, size=11, loc="left")
        _paint(plane, chosen, _TURNING)
        plane.set(xlabel="forward, m/s", ylabel="turning, rad/s")
        seen += [*chosen.ravel().tolist(), *up.tolist(), *down.tolist()]
    patches = [Patch(color=_COLORS[k], label=str(LABELS[k])) for k in sorted(set(seen))]
    figure.legend(
        handles=patches, loc="outside lower center", ncols=6, frameon=False, fontsize=9
    )
    return figure


def _paint(axes: Axes, labels: Integers, heights: Array) -> None:
    axes.pcolormesh(
        _FORWARD,
        heights,
        labels,
        cmap=ListedColormap(_COLORS),
        vmin=-0.5,
        vmax=len(LABELS) - 0.5,
        shading="nearest",
    )
