"""Metrics of a motion from its geometry, each with one definition.

All are computed from joint angles and trunk poses by the robot's kinematics and never
from contact labels, so they are comparable for motion of any origin.
"""

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_rotate
from loco_drake.models.legged import LeggedRobot
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.motion import Motion

# A toe sphere with its lowest point this near to the ground is in stance, m.
STANCE_HEIGHT = 0.010
# Tolerance for rounding in files and solver, rad.
_LIMIT_TOLERANCE = 1e-6


def toe_trajectories(motion: Motion, robot: LeggedRobot) -> Array:
    """Returns the centres of the toe spheres p_WF in m; of four legs (T, 4, 3)."""
    p_BF = robot.toe_positions(motion.joint_positions)
    p_BoF_W = quat_rotate(motion.base_quaternion[:, None], p_BF)
    return motion.base_position[:, None] + p_BoF_W


def stance_slip_speeds(p_WF: Array, foot_radius: float, fps: float) -> Array:
    """Returns the horizontal speed in m/s of each toe in each step of its stance, (N,).

    A toe, with its sphere's centre at p_WF (T, N, 3), is in stance if the lowest point
    of its sphere is within 10 mm of the ground, or below it, in two consecutive frames.
    The speed is that between these frames.
    """
    low = p_WF[..., 2] - foot_radius <= STANCE_HEIGHT
    stance = low[1:] & low[:-1]
    steps = np.diff(p_WF[..., :2], axis=0)
    return np.hypot(steps[..., 0], steps[..., 1])[stance] * fps


def stance_slip_median(p_WF: Array, foot_radius: float, fps: float) -> float | None:
    """Returns the median of :func:`stance_slip_speeds`, None without any stance."""
    speeds = stance_slip_speeds(p_WF, foot_radius, fps)
    return float(np.median(speeds)) if len(speeds) else None


def penetration_max(p_WF: Array, foot_radius: float) -> float:
    """Returns the largest depth of a toe sphere below the ground, m, at least 0."""
    return float(max(0.0, foot_radius - p_WF[..., 2].min()))


def joint_limit_violations(joints: Array, robot: LeggedRobot) -> int:
    """Returns the number of ``joints`` (T, J) outside the position limits."""
    below = joints < robot.joint_lower - _LIMIT_TOLERANCE
    above = joints > robot.joint_upper + _LIMIT_TOLERANCE
    return int((below | above).sum())


def joint_speed_ratio_max(joints: Array, robot: LeggedRobot, fps: float) -> float:
    """Returns the highest ratio of joint speed to its limit; up to 1 is valid.

    Speeds are those between consecutive frames of ``joints`` (T, J).
    """
    speeds = np.abs(np.diff(joints, axis=0)) * fps
    return float((speeds / robot.joint_speed_limits).max())


def toes_in_place_share(joints: Array, robot: Quadruped) -> float:
    """Returns the share of frames in which the toes are in place, for the worst toe.

    A left toe is in place left of the trunk's midline, a right toe right of it, and a
    front toe ahead of the rear toe on its side.
    """
    p_BF = robot.toe_positions(joints)
    beside = p_BF[..., 1] * np.array([1.0, -1.0, 1.0, -1.0]) > 0
    ahead = p_BF[:, :2, 0] > p_BF[:, 2:, 0]
    return float(min(beside.mean(axis=0).min(), ahead.mean(axis=0).min()))


def distance_rmse(a: Array, b: Array) -> float:
    """Returns the root mean square Euclidean distance of points (..., 3), m."""
    return float(np.sqrt(((a - b) ** 2).sum(axis=-1).mean()))
