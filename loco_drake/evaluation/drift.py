"""Drift: the difference between the end and the beginning of long motion.

The last 10 s of each motion are compared with its first 10 s in five figures:

speed            of the base along its heading, m/s
height           mean height of the base, m
turn rate        change of the heading over the 10 s, rad/s
stride period    see :mod:`loco_drake.motion.gait_timing`, s
slip             median speed of the toes in stance, m/s

The change of a figure is the median over motions of ``|last - first|``. Its tolerance
is the difference that 95 % of pairs of first windows of different seeds do not exceed,
and at least the RESOLUTION of the figure. Drift is change over tolerance, and the drift
of a generator is that of the worst figure of the worst gait. Up to 1, the last 10 s
differ from the first no more than two samples of the gait do; chance alone gives about
.35 per figure. A lost rhythm counts as a change by the whole period.

:func:`beyond_recorded` compares turning and height with recordings: the RMS change of
heading within 2 s in the last 10 s over that of recordings, or over .04 rad; and the
change of height from first to last 10 s over the difference that 95 % of pairs of
recordings of 2 s do not exceed, or over 1 mm.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.distance import pdist

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import yaw_of
from loco_drake.evaluation.motion_scores import mean_speed
from loco_drake.evaluation.samples import cut
from loco_drake.models.robots import Robot
from loco_drake.motion.gait_timing import motion_track, stride_period
from loco_drake.motion.motion import Motion
from loco_drake.motion.quality import stance_slip_median, toe_trajectories

SECONDS = 60.0
WINDOW = 10.0
# What a difference must exceed to matter at all.
RESOLUTION = {
    "speed_mps": 0.01,
    "height_m": 0.001,
    "turn_rate_radps": 0.02,
    "stride_period_s": 0.005,
    "stance_slip_median_mps": 0.005,
}


def drift(robot: Robot, motions: Sequence[Motion]) -> dict[str, Any]:
    """Returns the drift of each figure, of motions of one gait; see above.

    Two or more motions of different seeds are longer than 2 WINDOW. The result has, for
    each figure, its means in the first and last WINDOW seconds, the share of motions
    that lost it, change, tolerance, and drift. A figure that fewer than two motions
    have in their first window, such as a stride period of robots that stand, is left
    out.
    """
    first, last = (
        _table(robot, side)
        for side in zip(*(_ends(motion) for motion in motions), strict=True)
    )
    result = {}
    for column, (name, resolution) in enumerate(RESOLUTION.items()):
        known = ~np.isnan(first[:, column])
        begin, end = first[known, column], last[known, column]
        if len(begin) < 2:
            continue
        lost = np.isnan(end)
        tolerance = _tolerance(begin, resolution)
        change = float(np.median(np.abs(np.where(lost, 0.0, end) - begin)))
        result[name] = {
            "first": float(begin.mean()),
            "last": None if lost.all() else float(end[~lost].mean()),
            "lost": float(lost.mean()),
            "change": change,
            "tolerance": tolerance,
            "drift": change / tolerance,
        }
    return result


def beyond_recorded(
    motions: Sequence[Motion], recorded: Sequence[Motion]
) -> dict[str, float]:
    """Returns change of heading and height against those of recordings; see above.

    Motions are of one gait and longer than 2 WINDOW. At least one of the recorded
    stretches is 2 s long. The ratios, ``turn_over_recorded`` and
    ``height_over_recorded``, are at most 1 if motions change no more than recordings.
    """
    begins, ends = zip(*(_ends(motion) for motion in motions), strict=True)
    cuts = cut(recorded)
    turn, usual = (
        float(np.sqrt(np.mean([_turn(part) ** 2 for part in side])))
        for side in (cut(ends), cuts)
    )
    least = RESOLUTION["turn_rate_radps"] * cuts[0].duration
    first, last, heights = (
        np.array([m.base_position[:, 2].mean() for m in side])
        for side in (begins, ends, cuts)
    )
    tolerance = _tolerance(heights, RESOLUTION["height_m"])
    return {
        "turn_2s_rad": turn,
        "recorded_turn_2s_rad": usual,
        "turn_over_recorded": turn / max(usual, least),
        "height_over_recorded": float(np.median(np.abs(last - first))) / tolerance,
    }


def _ends(motion: Motion) -> tuple[Motion, Motion]:
    """Returns the first and the last WINDOW seconds."""
    window = round(WINDOW * motion.fps)
    return motion.slice(0, window), motion.slice(len(motion) - window, len(motion))


def _tolerance(values: Array, resolution: float) -> float:
    """Returns the 95th percentile of differences of pairs, at least the resolution."""
    apart = pdist(values[:, None], "cityblock")
    return max(resolution, float(np.quantile(apart, 0.95)) if len(apart) else 0.0)


def _turn(motion: Motion) -> float:
    """Returns the change of the heading from first to last frame, rad."""
    yaw = np.unwrap(yaw_of(motion.base_quaternion))
    return float(yaw[-1] - yaw[0])


def worst(drifts: dict[str, dict[str, Any]]) -> dict[str, Any] | None:
    """Returns the worst of :func:`drift` by label; None if nothing was measured."""
    found = (
        {"drift": figures["drift"], "label": label, "figure": name}
        for label, by_name in drifts.items()
        for name, figures in by_name.items()
    )
    return max(found, key=lambda each: tuple(each.values()), default=None)


def _table(robot: Robot, windows: Sequence[Motion]) -> Array:
    """Returns the figures of each window, NaN for those that it does not have."""
    rows = [
        (
            mean_speed(robot, motion),
            motion.base_position[:, 2].mean(),
            _turn(motion) / motion.duration,
            stride_period(motion_track(motion, robot)),
            stance_slip_median(
                toe_trajectories(motion, robot), robot.foot_radius, motion.fps
            ),
        )
        for motion in windows
    ]
    return np.array(rows, dtype=np.float64)
