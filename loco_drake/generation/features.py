"""Features: motion as vectors that do not depend on position and heading.

A frame is described relative to the one before it, in its heading frame H: z up, x
along the trunk's heading, midway between the headings of the two frames. Lengths are in
units of the robot's stand height, so features transfer between robots of similar
proportions.
"""

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import (
    quat_conjugate,
    quat_multiply,
    rotate_plane,
    yaw_of,
    yaw_quat,
)
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import FPS, Motion

Array = NDArray[np.float64]

# Columns of a feature vector.
VELOCITY = slice(0, 2)  # v_WB along x and y of H, in stand heights per second
YAW_RATE = slice(2, 3)  # rad/s
HEIGHT = slice(3, 4)  # of the trunk frame over the ground, in stand heights
ROLL_PITCH = slice(4, 6)  # rad
# Robot.backward_angles, rad, in the order of robot.joint_names; of Go2 and A1 they are
# the joints.
JOINTS = slice(6, 18)
CONTACTS = slice(18, 22)  # 1 on the ground, 0 in the air; FL, FR, RL, RR
SIZE = 22


def motion_features(robot: Robot, motion: Motion) -> Array:
    """Returns the features of ``motion``, shape (T, SIZE).

    The first frame has the velocity and yaw rate of the second.

    Raises:
        InputError: if the motion is of another robot or not at FPS.
    """
    if motion.robot != robot.name:
        raise InputError(f"The motion is of {motion.robot}, not of {robot.name}.")
    if motion.fps != FPS:
        raise InputError(f"The motion is at {motion.fps:g} frames/s, not at {FPS:g}.")
    yaw = np.unwrap(yaw_of(motion.base_quaternion))
    turn = np.diff(yaw)
    step = np.diff(motion.base_position[:, :2], axis=0)
    step_H = rotate_plane(step, -(yaw[:-1] + turn / 2))
    features = np.empty((len(motion), SIZE))
    features[1:, VELOCITY] = step_H * FPS / robot.stand_height
    features[1:, YAW_RATE] = turn[:, None] * FPS
    features[0, :3] = features[1, :3]
    features[:, HEIGHT] = motion.base_position[:, 2:] / robot.stand_height
    features[:, ROLL_PITCH] = _roll_pitch(motion.base_quaternion, yaw)
    features[:, JOINTS] = robot.backward_angles(motion.joint_positions)
    features[:, CONTACTS] = motion.contacts
    return features


def positions(robot: Robot, features: Array, path: Array) -> Array:
    """Returns q = [R_WB as w x y z, p_WB, joints], shape (..., T, 19).

    Features are (..., T, SIZE); ``path`` is x, y, yaw of each frame, (..., T, 3).
    """
    half_roll, half_pitch = np.moveaxis(features[..., ROLL_PITCH], -1, 0) / 2
    zero = np.zeros_like(half_roll)
    q_roll = np.stack((np.cos(half_roll), np.sin(half_roll), zero, zero), axis=-1)
    q_pitch = np.stack((np.cos(half_pitch), zero, np.sin(half_pitch), zero), axis=-1)
    q_HB = quat_multiply(q_pitch, q_roll)
    q_WB = quat_multiply(yaw_quat(path[..., 2]), q_HB)
    height = features[..., HEIGHT] * robot.stand_height
    joints = robot.joints_of_backward(features[..., JOINTS])
    return np.concatenate((q_WB, path[..., :2], height, joints), axis=-1)


def _roll_pitch(q_WB: Array, yaw: Array) -> Array:
    """Returns roll about x and pitch about y, in rad, after the yaw is undone."""
    q_HB = quat_multiply(quat_conjugate(yaw_quat(yaw)), q_WB)
    w, x, y, z = np.moveaxis(q_HB, -1, 0)
    roll = np.arctan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    return np.stack((roll, pitch), axis=-1)
