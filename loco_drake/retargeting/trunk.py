"""A trunk high enough for the robot's legs: they fold less, and kneel before they do.

A robot whose knees all point backward cannot copy a low crawl of one whose knees point
at each other: a foot far ahead of its hip takes the knee to the ground.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from loco_drake.common.rotations import quat_rotate
from loco_drake.models.quadruped import Quadruped
from loco_drake.retargeting.scaling import Targets

Array = NDArray[np.float64]

# A leg in stance right under its hip is at least this much longer than fully folded.
FOLD_MARGIN = 1.1
# Height of the knees' axes over the ground in m: the thigh's radius and some air.
KNEE_CLEARANCE = 0.03
# Over this time before and after a lift the trunk rises and sinks, s.
RAMP_SECONDS = 0.14

_MAX_ROUNDS = 6
_CLOSE_ENOUGH = 0.002


def raise_trunk(targets: Targets, robot: Quadruped, fps: float) -> Targets:
    """Returns ``targets`` with the trunk raised where the legs ask for it.

    That is where a hip is so low that a leg under it could not fold enough, or a knee
    is lower than :data:`KNEE_CLEARANCE`. Heading, pitch and toes are kept; the trunk
    rises and sinks gently.
    """
    lowest_hip = robot.foot_radius + FOLD_MARGIN * robot.folded_length
    ramp = round(RAMP_SECONDS * fps)
    for _ in range(_MAX_ROUNDS):
        hips, knees = _hip_and_knee_heights(targets, robot)
        missing = np.maximum(lowest_hip - hips, KNEE_CLEARANCE - knees)
        if missing.max() < _CLOSE_ENOUGH:
            break
        lift = _gentle_envelope(np.maximum(missing, 0.0), ramp)
        up = np.array([0.0, 0.0, 1.0])
        targets = replace(targets, p_WB=targets.p_WB + lift[:, None] * up)
    return targets


def _hip_and_knee_heights(targets: Targets, robot: Quadruped) -> tuple[Array, Array]:
    """Returns the heights in m of the lowest hip and the lowest knee, each (T,)."""
    p_BKnee = robot.knee_positions(robot.nearest_joints(targets.p_BF))
    q_WB, height = targets.q_WB[:, None], targets.p_WB[:, 2]
    p_BHip = np.broadcast_to(robot.p_BHip, p_BKnee.shape)
    hips, knees = (
        height + quat_rotate(q_WB, points)[..., 2].min(axis=1)
        for points in (p_BHip, p_BKnee)
    )
    return hips, knees


def _gentle_envelope(values: Array, ramp: int) -> Array:
    """Returns a smooth curve that is nowhere below ``values`` (T,).

    The means are taken over no more frames than the maximum before them, so each of the
    values that are averaged is at least that of the frame in the middle.
    """
    half = ramp // 2
    envelope: Array = maximum_filter1d(values, 4 * half + 1, mode="nearest")
    for _ in range(2):
        envelope = uniform_filter1d(envelope, 2 * half + 1, mode="nearest")
    return envelope
