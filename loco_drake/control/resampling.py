"""Positions of a plan between its samples, where a spline may go too far."""

import numpy as np
from scipy.interpolate import CubicSpline

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_conjugate, quat_continuous, quat_rotate
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION
from loco_drake.models.robots import Robot

# Joints and toes that are too far by less are left as they are, rad and m.
_ROUNDING = 1e-9


def positions_at(
    robot: Robot, times: Array, q: Array, p_WF: Array, wanted: Array
) -> Array:
    """Returns q at the times ``wanted`` (M,) by a cubic spline, shape (M, 19).

    No joint exceeds its limits and no toe is below the ground, unless one of the
    samples is.

    Args:
        robot: the robot.
        times: of the samples, shape (N,).
        q: samples, shape (N, 19).
        p_WF: their toes, shape (N, 4, 3).
        wanted: times from first to last sample.
    """
    waypoints = q.copy()
    waypoints[ORIENTATION] = quat_continuous(waypoints[ORIENTATION])
    result: Array = CubicSpline(times, waypoints)(wanted)
    result[ORIENTATION] /= np.linalg.norm(result[ORIENTATION], axis=1, keepdims=True)
    ends = waypoints[JOINTS].min(axis=0), waypoints[JOINTS].max(axis=0)
    lower = np.minimum(robot.joint_lower, ends[0]) - _ROUNDING
    upper = np.maximum(robot.joint_upper, ends[1]) + _ROUNDING
    joints = np.clip(result[JOINTS], lower, upper)
    q_WB, p_WB = result[ORIENTATION][:, None], result[POSITION][:, None]
    toes = p_WB + quat_rotate(q_WB, robot.toe_positions(joints))
    ground = min(robot.foot_radius, float(p_WF[..., 2].min())) - _ROUNDING
    sunk = toes[..., 2] < ground
    if sunk.any():
        toes[..., 2] = np.maximum(toes[..., 2], ground)
        raised = robot.leg_joints(quat_rotate(quat_conjugate(q_WB), toes - p_WB))
        joints = np.where(np.repeat(sunk, 3, axis=-1), raised, joints)
        joints = np.clip(joints, lower, upper)
    result[JOINTS] = joints
    return result
