"""How well recordings are retargeted, label by label.

The figures of a clip are those of :mod:`loco_drake.motion.quality`,
:class:`loco_drake.retargeting.report.RetargetReport` and :class:`GaitFidelity`. A
label's figures are made of its clips':

* stance_slip_median_mps: median over all steps of all toes in stance of all clips
* penetration_max_m: the worst clip's
* joint_limit_violations: summed
* joint_speed_ratio_max: the worst clip's
* toe_error_rmse_m: root of the mean square over all frames and toes of all clips
* correction_rmse_m: the same
* trunk_correction_rmse_m: root of the mean square over all frames of all clips
* stride_period_error, phase_lag_error, duty_factor_error: mean over the clips of at
  least three strides
* clips: their number; those that failed are not counted
* frames_per_second: frames of motion over seconds of computing in one process,
  reading excluded
* figures of grounding: root of the mean square over all frames of all clips that have
  the figure; only if motion is grounded

Beside them is what the motion is, see :mod:`loco_drake.evaluation.library`.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.datasets.segments import Segment
from loco_drake.datasets.split import Split
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.evaluation.library import (
    MotionPoint,
    describe,
    library_results,
    make_library,
)
from loco_drake.evaluation.motion_scores import median
from loco_drake.evaluation.samples import labels_of
from loco_drake.models.quadruped import Quadruped
from loco_drake.models.robots import ROBOTS, load_robot
from loco_drake.motion.gait_timing import (
    GaitTiming,
    Track,
    clip_track,
    gait_timing,
    motion_track,
)
from loco_drake.motion.quality import stance_slip_speeds, toe_trajectories
from loco_drake.retargeting.report import RetargetReport
from loco_drake.retargeting.retarget import SegmentRetargeter
from loco_drake.retargeting.scaling import AS_RECORDED, Variant

# The animal decides whether there are enough strides: a robot's motion can end a frame
# before its clip, and a slower robot makes fewer strides.
_ROBOT_STRIDES = 2


@dataclass(frozen=True)
class GaitFidelity:
    """Errors of the gait timing of a robot; 0 is perfect."""

    stride_period_error: float  # |T_robot / T_source - 1|
    # The largest error of the lag of one toe behind another, over the six pairs of
    # toes; a share of the stride, around the circle, so at most .5. So no toe has a
    # special part, and one wrong toe is one error.
    phase_lag_error: float
    duty_factor_error: float  # mean over the toes of the absolute error


# Of a robot that has no rhythm, or fewer than two strides, where the animal has three.
NO_RHYTHM = GaitFidelity(
    stride_period_error=1.0, phase_lag_error=0.5, duty_factor_error=1.0
)
_FIDELITY = tuple(vars(NO_RHYTHM))


def gait_fidelity(source: Track, robot: Track) -> GaitFidelity | None:
    """Returns the errors of the robot's gait timing against the animal's.

    None if the animal makes fewer than three strides; :data:`NO_RHYTHM` if the robot
    then makes fewer than two.
    """
    own = gait_timing(source)
    if own is None:
        return None
    made = gait_timing(robot, _ROBOT_STRIDES)
    return NO_RHYTHM if made is None else timing_errors(own, made)


def timing_errors(source: GaitTiming, robot: GaitTiming) -> GaitFidelity:
    """Returns the differences between the gait timing of a robot and an animal."""
    late = robot.phase_lags - source.phase_lags
    between = (late[:, None] - late + 0.5) % 1.0 - 0.5
    duty = np.abs(robot.duty_factors - source.duty_factors)
    return GaitFidelity(
        stride_period_error=abs(robot.stride_period / source.stride_period - 1),
        phase_lag_error=float(np.abs(between).max()),
        duty_factor_error=float(duty.mean()),
    )


@dataclass(frozen=True)
class ClipScore:
    """The figures of one clip."""

    segment: Segment  # the stretch of a recording
    report: RetargetReport  # what retargeting says
    slip_speeds: Array  # of each step of each toe in stance, m/s, shape (N,)
    fidelity: GaitFidelity | None  # None if there are fewer than three strides
    point: MotionPoint | None = None  # None of a robot that is not of ROBOTS


@dataclass(frozen=True)
class FailedClip:
    """A clip that could not be retargeted, and why."""

    segment: Segment
    error: str


class _Scorer:
    """Retargets and scores, see :func:`score_segments`."""

    def __init__(self, robot: str, split: Split | None, variant: Variant) -> None:
        self._retarget = SegmentRetargeter(load_robot(robot), split, variant)

    def __call__(self, segment: Segment) -> ClipScore | FailedClip:
        result = self._retarget(segment)
        if isinstance(result, str):
            return FailedClip(segment, result)
        clip, motion, report = result
        robot = self._retarget.robot
        p_WF = toe_trajectories(motion, robot)
        track = clip_track(clip, robot.stand_height / report.scale)
        return ClipScore(
            segment=segment,
            report=report,
            slip_speeds=stance_slip_speeds(p_WF, robot.foot_radius, motion.fps),
            fidelity=gait_fidelity(track, motion_track(motion, robot)),
            point=describe(motion) if robot.name in ROBOTS else None,
        )


def score_segments(
    segments: Iterable[Segment],
    robot: Quadruped,
    executor: Executor = LOCAL,
    variant: Variant = AS_RECORDED,
    split: Split | None = None,
) -> Iterator[ClipScore | FailedClip]:
    """Retargets segments, and yields the figures of each, in their order.

    Without a ``split`` all are for training. A process has only one clip at a time in
    memory. The rhythm of a variant is compared with that of the recording in the
    motion's time.
    """
    make = partial(_Scorer, robot.definition, split, variant)
    return executor.map(make, segments)


def summarize(scores: Sequence[ClipScore | FailedClip]) -> dict[str, Any]:
    """Returns what ``loco-drake evaluate retargeting`` writes for a robot.

    "labels", "all", "frames_per_second", "failed", and "other" for labels that are not
    among the fifteen, which "all" and "library" leave out; "warnings" has sentences by
    clip, see :mod:`loco_drake.retargeting.bounds`. The library is null if it is empty.
    """
    by_label: dict[str, list[ClipScore]] = {}
    for score in scores:
        clips = by_label.setdefault(score.segment.label, [])
        if isinstance(score, ClipScore):
            clips.append(score)
    failed = [score for score in scores if isinstance(score, FailedClip)]
    done = [clip for clips in by_label.values() for clip in clips]
    names = labels_of(by_label)
    known = [clip for clip in done if clip.segment.label in names]
    frames = sum(clip.report.frames for clip in done)
    seconds = sum(clip.report.frames / clip.report.frames_per_second for clip in done)
    points = [clip.point for clip in known if clip.point is not None]
    return {
        "labels": {name: figures(by_label[name]) for name in names},
        "all": figures(known),
        "frames_per_second": frames / seconds if done else None,
        "library": library_results(make_library(points)) if points else None,
        "warnings": {
            clip.segment.name: warnings
            for clip in done
            if (warnings := clip.report.warnings)
        },
        "other": {k: figures(v) for k, v in by_label.items() if k not in names},
        "failed": {clip.segment.name: clip.error for clip in failed},
    }


def figures(clips: Sequence[ClipScore]) -> dict[str, Any]:
    """Returns the figures of clips taken together; null ones come with a reason."""
    fidelities = [clip.fidelity for clip in clips if clip.fidelity is not None]
    reports = [clip.report for clip in clips]
    steps = np.concatenate([np.empty(0), *(clip.slip_speeds for clip in clips)])
    frames = np.array([report.frames for report in reports])
    worst_clips = _worst_clips(clips)

    def pooled(key: str) -> float | None:
        squares = np.array([getattr(report, key) ** 2 for report in reports])
        return float(np.sqrt(squares @ frames / frames.sum())) if reports else None

    def pooled_grounding(key: str) -> float | None:
        found = [
            (value, report.frames)
            for report in reports
            if (value := getattr(report.grounding, key)) is not None
        ]
        if not found:
            return None
        values, weights = np.array(found, dtype=np.float64).T
        return float(np.sqrt(np.average(values**2, weights=weights)))

    def worst(key: str) -> float | None:
        return worst_clips[key]["value"] if reports else None

    result: dict[str, Any] = {
        "stance_slip_median_mps": median(steps),
        "penetration_max_m": worst("penetration_max_m"),
        "joint_limit_violations": sum(r.joint_limit_violations for r in reports),
        "joint_speed_ratio_max": worst("joint_speed_ratio_max"),
        "toe_error_rmse_m": pooled("toe_error_rmse_m"),
        "correction_rmse_m": pooled("correction_rmse_m"),
        "trunk_correction_rmse_m": pooled("trunk_correction_rmse_m"),
    }
    for key in _FIDELITY:
        values = [getattr(fidelity, key) for fidelity in fidelities]
        result[key] = float(np.mean(values)) if values else None
    if reports and reports[0].grounding is not None:
        for key in vars(reports[0].grounding):
            result[key] = pooled_grounding(key)
    result["clips"] = len(clips)
    result["clips_outside_bounds"] = sum(bool(r.warnings) for r in reports)
    result["clips_of_three_strides"] = len(fidelities)
    result["worst"] = worst_clips
    reasons = []
    if not clips:
        reasons.append("no clip could be retargeted")
    elif not len(steps):
        reasons.append("no toe ever stands")
    if clips and not fidelities:
        reasons.append("no clip holds three strides")
    if reasons:
        result["reason"] = "; ".join(reasons)
    return result


# Figures of a report of which the worst clip is told beside the label's own.
_WORST = (
    "stance_slip_median_mps",
    "penetration_max_m",
    "joint_speed_ratio_max",
    "toe_error_rmse_m",
    "correction_rmse_m",
    "trunk_correction_rmse_m",
)


def _worst_clips(clips: Sequence[ClipScore]) -> dict[str, dict[str, Any]]:
    """Returns the highest value of each figure, and the name of its clip."""
    worst = {}
    for key in (*_WORST, *_FIDELITY):
        values = [
            (value, clip.segment.name)
            for clip in clips
            for part in (clip.report, clip.fidelity)
            if (value := getattr(part, key, None)) is not None
        ]
        if values:
            value, name = max(values, key=itemgetter(0))
            worst[key] = {"value": value, "clip": name}
    return worst
