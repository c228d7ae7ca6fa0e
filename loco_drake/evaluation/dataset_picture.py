"""Plots of a library of motion: its distribution and diversity."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array
from loco_drake.datasets.split import TRAIN, VALIDATION
from loco_drake.evaluation.library import Library, MotionPoint
from loco_drake.motion.gaits import GAITS, LABELS, SOURCES

# A colour for each source, readable on white, on near-black and by the colour-blind; a
# marker for each gait.
_PALETTE = ("#d9730d", "#2e86c9", "#1f9d6b", "#b5569b")
COLORS = dict(zip(SOURCES, _PALETTE, strict=True))
MARKERS = dict(zip(GAITS, "so^v<>DP", strict=True))


def library_figure(library: Library) -> Figure:
    """Returns a figure of four plots: seconds, gait timing, duty factor, an embedding.

    Colours stand for sources and markers for gaits; validation is hollow.
    """
    figure = Figure(figsize=(11, 8.2), layout="constrained")
    seconds, rhythm, duty, embedding = figure.subplots(2, 2).flat
    _draw_seconds(seconds, library.points)
    for point in library.points:
        if point.stride_period is not None and point.duty_factor is not None:
            _mark(rhythm, point, np.array([[point.speed, point.stride_period]]))
            _mark(duty, point, np.array([[point.speed, point.duty_factor]]))
        if len(point.summaries):
            _mark(embedding, point, point.summaries)
    rhythm.set(xlabel="speed, m/s", ylabel="stride period, s")
    duty.set(xlabel="speed, m/s", ylabel="duty factor")
    first, second = library.variance
    embedding.set(
        xlabel=f"first principal component, {first:.0%}",
        ylabel=f"second, {second:.0%}",
        title="features of every 2 s",
    )
    handles = [
        rhythm.scatter([], [], color=COLORS[label.source], marker=MARKERS[label.gait])
        for label in LABELS
    ]
    names = [str(label) for label in LABELS]
    rhythm.legend(handles, names, loc="upper right", fontsize=8, ncols=2)
    return figure


def _draw_seconds(axes: Axes, points: Sequence[MotionPoint]) -> None:
    """Draws a bar for each label: its seconds, those for validation hollow."""
    left = np.zeros(len(LABELS))
    rows = range(len(LABELS), 0, -1)
    colors = [COLORS[label.source] for label in LABELS]
    for side in (TRAIN, VALIDATION):
        own = np.zeros(len(LABELS))
        for point in points:
            if point.side == side:
                own[point.label.index] += point.seconds
        face = colors if side == TRAIN else "none"
        axes.barh(rows, own, left=left, facecolor=face, edgecolor=colors)
        left += own
    axes.set_yticks(rows, [str(label) for label in LABELS])
    axes.set(xlabel="seconds; hollow: for validation")


def _mark(axes: Axes, point: MotionPoint, xy: Array) -> None:
    color = COLORS[point.label.source]
    axes.scatter(
        xy[:, 0],
        xy[:, 1],
        s=22,
        marker=MARKERS[point.label.gait],
        facecolor=color if point.side == TRAIN else "none",
        edgecolor=color,
        linewidth=0.8,
    )
