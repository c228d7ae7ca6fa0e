"""The observation of the policy: the robot's state, and the plan relative to it."""

from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array, Bools, Integers
from loco_drake.common.rotations import (
    heading_matrix,
    quat_conjugate,
    quat_log,
    quat_multiply,
    quat_to_matrix,
)
from loco_drake.control.plan import Plan
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    HEIGHT,
    JOINT_VELOCITIES,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
    split,
)
from loco_drake.models.legs import (
    MIRROR_AXIAL,
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_LEGS,
    MIRROR_POLAR,
)
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import ONE_HOT, ONE_HOT_SIZE

# Samples of the plan, counted from the current one, that the policy observes.
LOOK_AHEAD = np.array([1, 2, 4, 8])
_K = len(LOOK_AHEAD)

# How a part is mirrored left-right: order and signs of its numbers, which may repeat.
_POLAR = ([0, 1, 2], MIRROR_POLAR)
_AXIAL = ([0, 1, 2], MIRROR_AXIAL)
_JOINTS = (MIRROR_JOINTS, MIRROR_JOINT_SIGNS)
_FEET = (MIRROR_LEGS, [1.0] * 4)
_SAME = ([0], [1.0])

# Name, size and mirroring of each part, in order. H is the heading frame: its origin is
# the base's, z is up, x is the base's x in the plane.
_PARTS = (
    ("gravity_B", 3, _POLAR),  # direction of gravity
    ("w_WB_B", 3, _AXIAL),  # rad/s
    ("v_WB_H", 3, _POLAR),  # m/s
    ("height", 1, _SAME),  # z of the base, m
    ("joint_positions", 12, _JOINTS),  # from the standing pose, rad
    ("joint_velocities", 12, _JOINTS),  # a tenth of rad/s
    ("last_action", 12, _JOINTS),
    ("plan_joint_velocities", 12, _JOINTS),  # of the next sample, a tenth of rad/s
    ("plan_joints", 12 * _K, _JOINTS),  # plan minus robot, rad
    ("plan_p_H", 3 * _K, _POLAR),  # base position of the plan from the robot's, m
    ("plan_R_B", 3 * _K, _AXIAL),  # base rotation from the robot's, so(3), rad
    ("plan_v_H", 3 * _K, _POLAR),  # base velocity of the plan, m/s
    ("plan_w_H", 3 * _K, _AXIAL),  # base angular velocity of the plan, rad/s
    ("plan_contacts", 4 * _K, _FEET),
    ("label", ONE_HOT_SIZE, _SAME),  # one-hot of the source, one-hot of the gait
)
# What a policy's weights record: names and sizes.
OBSERVATION_LAYOUT = tuple((name, size) for name, size, _ in _PARTS)
OBSERVATION_SIZE = sum(size for _, size in OBSERVATION_LAYOUT)
_ENDS = np.cumsum([size for _, size in OBSERVATION_LAYOUT]).tolist()
# Where each part is in the observation.
PLACES = {
    name: slice(end - size, end)
    for (name, size), end in zip(OBSERVATION_LAYOUT, _ENDS, strict=True)
}


def _mirror() -> tuple[Integers, Array]:
    """Returns order and signs of all numbers of a mirrored observation."""
    orders, signs, start = [], [], 0
    for _, size, (order, sign) in _PARTS:
        repeats = size // len(order)
        orders += [start + k * len(order) + np.array(order) for k in range(repeats)]
        signs += [sign] * repeats
        start += size
    return np.concatenate(orders), np.concatenate(signs)


MIRROR_OBSERVATION, MIRROR_OBSERVATION_SIGNS = _mirror()


@dataclass(frozen=True)
class Preview:
    """The part of a plan that the policy observes, K samples of any leading shape."""

    q: Array  # positions as in Plan, shape (..., K, 19)
    v: Array  # velocities as in Plan, shape (..., K, 18)
    contacts: Bools  # shape (..., K, 4)
    label: Integers  # row of motion.gaits.ONE_HOT of the present, shape (...)


def preview(plan: Plan, time: float) -> Preview:
    """Returns the preview of ``plan`` at a Context time in s."""
    now = plan.index(time)
    k = np.minimum(now + LOOK_AHEAD, len(plan) - 1)
    return Preview(plan.q[k], plan.v[k], plan.contacts[k], plan.labels[now])


def observe(robot: Robot, ahead: Preview, state: Array, action: Array) -> Array:
    """Returns observations, shape (..., OBSERVATION_SIZE).

    ``state`` (..., 37) is [q, v] with a unit quaternion, ``action`` (..., 12) the one
    in use.
    """
    q, v = split(state)
    robots = q[..., None, :]  # against the samples ahead
    R_WB = quat_to_matrix(q[ORIENTATION])
    R_WH = heading_matrix(R_WB)
    parts = (
        -R_WB[..., 2, :],
        _times(v[ANGULAR_VELOCITY], R_WB),
        _times(v[VELOCITY], R_WH),
        q[..., HEIGHT, None],
        q[JOINTS] - robot.stand_joints,
        0.1 * v[JOINT_VELOCITIES],
        action,
        0.1 * ahead.v[..., 0, :][JOINT_VELOCITIES],
        ahead.q[JOINTS] - robots[JOINTS],
        (ahead.q[POSITION] - robots[POSITION]) @ R_WH,
        quat_log(
            quat_multiply(quat_conjugate(robots[ORIENTATION]), ahead.q[ORIENTATION])
        ),
        ahead.v[VELOCITY] @ R_WH,
        ahead.v[ANGULAR_VELOCITY] @ R_WH,
        ahead.contacts,
        ONE_HOT[ahead.label],
    )
    shape = state.shape[:-1]
    return np.concatenate([part.reshape(*shape, -1) for part in parts], axis=-1)


def _times(rows: Array, R: Array) -> Array:
    """Returns row vectors (..., 3) times matrices (..., 3, 3)."""
    return (rows[..., None, :] @ R)[..., 0, :]
