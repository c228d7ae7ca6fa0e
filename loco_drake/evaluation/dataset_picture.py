"""Plots of a library of motion: its size and variety.

Like the paper's Figure 2, but for any folder of Motion files.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sklearn.decomposition import PCA
from sklearn.preprocessing import StandardScaler

from loco_drake.common.arrays import Array
from loco_drake.datasets.split import TRAIN, VALIDATION
from loco_drake.generation.features import SIZE, motion_features
from loco_drake.models.robots import get_robot
from loco_drake.motion.gait_timing import gait_timing, motion_track
from loco_drake.motion.gaits import GAITS, LABELS, SOURCES, GaitLabel
from loco_drake.motion.motion import Motion
from loco_drake.retargeting.trajectories import trajectories

# A colour for each source, a marker for each gait.
_TABLEAU = ("tab:blue", "tab:orange", "tab:green", "tab:red")
COLORS = dict(zip(SOURCES, _TABLEAU, strict=True))
MARKERS = dict(zip(GAITS, "so^v<>DP", strict=True))

_STRIDES = 2  # Solo8's clips hold few


@dataclass(frozen=True)
class MotionPoint:
    """Figures of one motion in the plot."""

    label: GaitLabel  # what it does
    side: str  # of the split
    seconds: float  # its length
    speed: float  # mean horizontal speed of the trunk in m/s
    stride_period: float | None  # s, None with less than two strides
    duty_factor: float | None  # mean of the feet, None with less than two strides
    # Mean and standard deviation of each feature (loco_drake.generation.features) in
    # every 2 s, shape (N, 44).
    embedding: Array


def describe(motion: Motion) -> MotionPoint:
    """Returns the figures of a motion of at least two frames."""
    robot = get_robot(motion.robot)
    timing = gait_timing(motion_track(motion, robot), _STRIDES)
    features = [motion_features(robot, cut) for cut in trajectories(motion)]
    rows = [np.concatenate((f.mean(axis=0), f.std(axis=0))) for f in features]
    velocity = motion.base_velocity[:, :2]
    return MotionPoint(
        label=motion.label,
        side=motion.provenance.get("split", TRAIN),
        seconds=motion.duration,
        speed=float(np.hypot(velocity[:, 0], velocity[:, 1]).mean()),
        stride_period=timing.stride_period if timing else None,
        duty_factor=float(timing.duty_factors.mean()) if timing else None,
        embedding=np.array(rows).reshape(len(rows), 2 * SIZE),
    )


def principal_components(rows: Array, count: int = 2) -> tuple[Array, Array]:
    """Returns projections (N, count) of rows (N, D), and each one's share of variance.

    Columns are first divided by their standard deviation.
    """
    scaled = StandardScaler().fit_transform(rows)
    analysis = PCA(count, svd_solver="full")
    return analysis.fit_transform(scaled), analysis.explained_variance_ratio_


def library_figure(points: Iterable[MotionPoint], title: str) -> Figure:
    """Returns a figure of four plots: seconds, gait timing, duty factor, an embedding.

    All motions have one of the fifteen labels. Colours stand for sources and markers
    for gaits; validation is hollow.
    """
    points = list(points)
    figure = Figure(figsize=(12, 9), layout="constrained")
    figure.suptitle(title)
    seconds, rhythm, duty, embedding = figure.subplots(2, 2).flat
    _draw_seconds(seconds, points)
    for point in points:
        if point.stride_period is not None and point.duty_factor is not None:
            _mark(rhythm, point, np.array([[point.speed, point.stride_period]]))
            _mark(duty, point, np.array([[point.speed, point.duty_factor]]))
    rhythm.set(xlabel="speed [m/s]", ylabel="stride period [s]")
    duty.set(xlabel="speed [m/s]", ylabel="duty factor")
    with_rows = [p for p in points if len(p.embedding)]
    counts = [len(p.embedding) for p in with_rows]
    if sum(counts) > 2:
        rows = np.concatenate([p.embedding for p in with_rows])
        projected, share = principal_components(rows)
        parts = np.split(projected, np.cumsum(counts)[:-1])
        for point, part in zip(with_rows, parts, strict=True):
            _mark(embedding, point, part)
        embedding.set(
            xlabel=f"first principal component, {share[0]:.0%}",
            ylabel=f"second, {share[1]:.0%}",
            title="features of every 2 s",
        )
    handles = [
        rhythm.scatter([], [], color=COLORS[label.source], marker=MARKERS[label.gait])
        for label in LABELS
    ]
    rhythm.legend(handles, [str(label) for label in LABELS], fontsize=8, ncols=2)
    return figure


def _draw_seconds(axes: Axes, points: list[MotionPoint]) -> None:
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
