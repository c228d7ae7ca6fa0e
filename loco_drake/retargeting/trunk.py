"""A trunk high enough for the robot's legs, which fold less than others do."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from loco_drake.models.robots import Robot
from loco_drake.retargeting.scaling import Targets
from loco_drake.rotations import quat_rotate

Array = NDArray[np.float64]

# A leg in stance right under its hip is at least this much longer than fully folded.
FOLD_MARGIN = 1.1
# Over this time before and after a lift the trunk rises and sinks, s.
RAMP_SECONDS = 0.14


def folded_length(robot: Robot) -> float:
    """Returns thigh joint to toe in m with the calf at its limit: as near as can be."""
    l1, l2 = robot.thigh_length, robot.calf_length
    square = l1**2 + l2**2 + 2 * l1 * l2 * np.cos(robot.joint_lower[2])
    return float(np.sqrt(square))


def lowest_hip_height(robot: Robot) -> float:
    """Returns the height in m over the ground under which no hip joint may be."""
    return robot.foot_radius + FOLD_MARGIN * folded_length(robot)


def raise_trunk(targets: Targets, robot: Robot, fps: float) -> Targets:
    """Returns ``targets`` with the trunk raised where a hip joint would be too low.

    Pitch and everything else are kept; the trunk rises gently, and never less than is
    needed.
    """
    p_BHip = np.broadcast_to(robot.p_BHip, (len(targets.p_WB), 4, 3))
    rise = quat_rotate(targets.q_WB[:, None], p_BHip)[..., 2].min(axis=1)
    missing = lowest_hip_height(robot) - (targets.p_WB[:, 2] + rise)
    lift = _gentle_envelope(np.maximum(missing, 0.0), round(RAMP_SECONDS * fps))
    return replace(targets, p_WB=targets.p_WB + lift[:, None] * np.array([0, 0, 1.0]))


def _gentle_envelope(values: Array, ramp: int) -> Array:
    """Returns a smooth curve that is nowhere below ``values`` (T,).

    The means are taken over no more frames than the maximum before them, so each of the
    values that are averaged is at least that of the frame in the middle.
    """
    half = ramp // 2
    envelope = maximum_filter1d(values, 4 * half + 1, mode="nearest")
    for _ in range(2):
        envelope = uniform_filter1d(envelope, 2 * half + 1, mode="nearest")
    smooth_envelope: Array = envelope
    return smooth_envelope
