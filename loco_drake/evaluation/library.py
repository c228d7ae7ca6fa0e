"""A library of motion: how much there is of each gait, and how it differs.

The distribution and diversity of the data set, as in the paper's Figure 2.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from sklearn.decomposition import PCA
from sklearn.preprocessing import StandardScaler

from loco_drake.common.arrays import Array
from loco_drake.datasets.split import TRAIN, VALIDATION
from loco_drake.evaluation.report.figures import Figures
from loco_drake.generation.features import SIZE, motion_features
from loco_drake.models.robots import get_robot
from loco_drake.motion.gait_timing import gait_timing, motion_track
from loco_drake.motion.gaits import LABELS, GaitLabel
from loco_drake.motion.motion import Motion
from loco_drake.retargeting.trajectories import trajectories

_STRIDES = 2  # Solo8's clips hold few
_DIGITS = 4  # of what is written
_BY_NAME = {str(label): label for label in LABELS}


@dataclass(frozen=True)
class MotionPoint:
    """Figures of one motion."""

    label: GaitLabel  # what it does, one of the fifteen
    side: str  # of the split
    seconds: float  # its length
    speed: float  # mean horizontal speed of the trunk in m/s
    stride_period: float | None  # s, None with less than two strides
    duty_factor: float | None  # mean of the feet, None with less than two strides
    # Of every 2 s, shape (N, D): mean and standard deviation of each feature
    # (loco_drake.generation.features), D = 44; in a Library the first two principal
    # components of these, D = 2.
    summaries: Array


@dataclass(frozen=True)
class Library:
    """Figures of motions, and what share of the variance each component has."""

    points: tuple[MotionPoint, ...]
    variance: tuple[float, float]

    @property
    def seconds(self) -> float:
        """Of all motions together, s."""
        return sum(point.seconds for point in self.points)


def describe(motion: Motion) -> MotionPoint:
    """Returns the figures of a motion of at least two frames, of one of ROBOTS."""
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
        summaries=np.array(rows).reshape(len(rows), 2 * SIZE),
    )


def principal_components(rows: Array, count: int = 2) -> tuple[Array, Array]:
    """Returns projections (N, count) of rows (N, D), and each one's share of variance.

    Columns are first divided by their standard deviation.
    """
    scaled = StandardScaler().fit_transform(rows)
    analysis = PCA(count, svd_solver="full")
    return analysis.fit_transform(scaled), analysis.explained_variance_ratio_


def make_library(points: Iterable[MotionPoint]) -> Library:
    """Returns the library of what :func:`describe` tells.

    Of fewer than three summaries there are no components.
    """
    points = list(points)
    counts = [len(point.summaries) for point in points]
    if sum(counts) < 3:
        none = np.empty((0, 2))
        return Library(tuple(replace(p, summaries=none) for p in points), (0.0, 0.0))
    rows = np.concatenate([point.summaries for point in points])
    projected, variance = principal_components(rows)
    parts = np.split(projected, np.cumsum(counts)[:-1])
    shown = (replace(p, summaries=q) for p, q in zip(points, parts, strict=True))
    return Library(tuple(shown), (float(variance[0]), float(variance[1])))


def library_results(library: Library) -> dict[str, Any]:
    """Returns a library as ``evaluate retargeting`` writes it."""

    def shown(value: float | None) -> float | None:
        return None if value is None else round(value, _DIGITS)

    clips = [
        {
            "label": str(point.label),
            "split": point.side,
            "duration_s": shown(point.seconds),
            "speed_mps": shown(point.speed),
            "stride_period_s": shown(point.stride_period),
            "duty_factor": shown(point.duty_factor),
            "components": point.summaries.round(_DIGITS).tolist(),
        }
        for point in library.points
    ]
    return {"variance": list(map(shown, library.variance)), "clips": clips}


def read_library(figures: Figures) -> Library:
    """Returns the library in the results of a robot; other labels are left out.

    Raises:
        InputError: if it is damaged.
    """
    found = figures.part("library")
    variance = found.vector("variance", 2)
    if variance is None:
        raise figures.damaged("its library has no variance")
    clips = found.objects("clips")
    points = [_read(clip) for clip in clips if clip.text("label") in _BY_NAME]
    return Library(tuple(points), (float(variance[0]), float(variance[1])))


def _read(clip: Figures) -> MotionPoint:
    side = clip.text("split")
    if side not in (TRAIN, VALIDATION):
        raise clip.damaged(f"split is {side!r}, neither {TRAIN} nor {VALIDATION}")
    seconds, speed = (clip.required(key) for key in ("duration_s", "speed_mps"))
    if seconds is None or speed is None:
        raise clip.damaged("a clip of its library has no duration or no speed")
    return MotionPoint(
        label=_BY_NAME[clip.text("label")],
        side=side,
        seconds=seconds,
        speed=speed,
        stride_period=clip.required("stride_period_s"),
        duty_factor=clip.required("duty_factor"),
        summaries=clip.pairs("components"),
    )
