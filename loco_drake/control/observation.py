"""The observation of the policy: the robot's state, and the plan relative to it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from loco_drake.common.arrays import Array, Bools, Integers, read_only
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
from loco_drake.models.simulated import SimulatedRobot
from loco_drake.motion.gaits import ONE_HOT, ONE_HOT_SIZE

# Samples of the plan, counted from the current one, that the policy observes.
LOOK_AHEAD = np.array([1, 2, 4, 8])
_K = len(LOOK_AHEAD)

# How a part is mirrored left-right: order and signs of its numbers, which may repeat.
_POLAR = ((0, 1, 2), tuple(MIRROR_POLAR))
_AXIAL = ((0, 1, 2), tuple(MIRROR_AXIAL))
_FEET = (tuple(MIRROR_LEGS), (1.0,) * 4)
_SAME = ((0,), (1.0,))
_Mirroring = tuple[tuple[int, ...], tuple[float, ...]]


class Layout:
    """Where everything is in an observation, and how it is mirrored left-right.

    Use :func:`layout_of`. H is the heading frame: its origin is the base's, z is up, x
    is the base's x in the plane.
    """

    def __init__(self, mirror_joints: Integers, mirror_joint_signs: Array) -> None:
        joints = (tuple(mirror_joints), tuple(mirror_joint_signs))
        parts = _parts(len(mirror_joints), joints)
        self.mirror_joints = read_only(np.array(mirror_joints))  # of actions, too
        self.mirror_joint_signs = read_only(np.array(mirror_joint_signs))
        # Names and sizes of the parts, in order.
        self.parts = tuple((name, size) for name, size, _ in parts)
        # The same as JSON has it: what weights and checkpoints record.
        self.record = tuple([name, size] for name, size, _ in parts)
        self.size = sum(size for _, size in self.parts)
        ends = np.cumsum([size for _, size in self.parts]).tolist()
        # Where each part is in the observation.
        self.places = {
            name: slice(end - size, end)
            for (name, size), end in zip(self.parts, ends, strict=True)
        }
        # Order and signs of all numbers of a mirrored observation, shape (size,).
        orders, signs, start = [], [], 0
        for _, size, (order, sign) in parts:
            repeats = size // len(order)
            orders += [start + k * len(order) + np.array(order) for k in range(repeats)]
            signs += [np.array(sign)] * repeats
            start += size
        self.mirror = read_only(np.concatenate(orders))
        self.mirror_signs = read_only(np.concatenate(signs))


def _parts(
    joints: int, mirrored: _Mirroring
) -> tuple[tuple[str, int, _Mirroring], ...]:
    """Returns name, size and mirroring of each part, in order."""
    return (
        ("gravity_B", 3, _POLAR),  # direction of gravity
        ("w_WB_B", 3, _AXIAL),  # rad/s
        ("v_WB_H", 3, _POLAR),  # m/s
        ("height", 1, _SAME),  # z of the base, m
        ("joint_positions", joints, mirrored),  # from the standing pose, rad
        ("joint_velocities", joints, mirrored),  # a tenth of rad/s
        ("last_action", joints, mirrored),
        # Of the next sample, a tenth of rad/s.
        ("plan_joint_velocities", joints, mirrored),
        ("plan_joints", joints * _K, mirrored),  # plan minus robot, rad
        ("plan_p_H", 3 * _K, _POLAR),  # base position of the plan from the robot's, m
        ("plan_R_B", 3 * _K, _AXIAL),  # base rotation from the robot's, so(3), rad
        ("plan_v_H", 3 * _K, _POLAR),  # base velocity of the plan, m/s
        ("plan_w_H", 3 * _K, _AXIAL),  # base angular velocity of the plan, rad/s
        ("plan_contacts", 4 * _K, _FEET),
        ("label", ONE_HOT_SIZE, _SAME),  # one-hot of the source, one-hot of the gait
    )


# Of robots with three joints a leg.
LAYOUT = Layout(MIRROR_JOINTS, MIRROR_JOINT_SIGNS)
OBSERVATION_LAYOUT = LAYOUT.parts
OBSERVATION_SIZE = LAYOUT.size
PLACES = LAYOUT.places
MIRROR_OBSERVATION, MIRROR_OBSERVATION_SIGNS = LAYOUT.mirror, LAYOUT.mirror_signs


def layout_of(robot: SimulatedRobot) -> Layout:
    """Returns the layout of a robot's observations."""
    return mirrored_layout(
        tuple(robot.mirror_joints.tolist()), tuple(robot.mirror_joint_signs.tolist())
    )


@lru_cache
def mirrored_layout(order: tuple[int, ...], signs: tuple[float, ...]) -> Layout:
    """Returns the layout of a robot whose joints are mirrored in this way.

    Args:
        order: number of the joint whose mirror image each joint is.
        signs: of the angles there.
    """
    layout = Layout(np.array(order), np.array(signs))
    # Robots with three joints a leg share one.
    same = (layout.parts, *order, *signs) == (
        LAYOUT.parts,
        *LAYOUT.mirror_joints,
        *LAYOUT.mirror_joint_signs,
    )
    return LAYOUT if same else layout


@dataclass(frozen=True)
class Preview:
    """The part of a plan that the policy observes, K samples of any leading shape."""

    q: Array  # positions as in Plan, shape (..., K, 7 + J)
    v: Array  # velocities as in Plan, shape (..., K, 6 + J)
    contacts: Bools  # shape (..., K, 4)
    label: Integers  # row of motion.gaits.ONE_HOT of the present, shape (...)


def preview(plan: Plan, time: float) -> Preview:
    """Returns the preview of ``plan`` at a Context time in s."""
    now = plan.index(time)
    k = np.minimum(now + LOOK_AHEAD, len(plan) - 1)
    return Preview(plan.q[k], plan.v[k], plan.contacts[k], plan.labels[now])


def observe(
    robot: SimulatedRobot, ahead: Preview, state: Array, action: Array
) -> Array:
    """Returns observations, shape (..., size of its Layout).

    ``state`` (..., 13 + 2 J) is [q, v] with a unit quaternion, ``action`` (..., J) the
    one in use.
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
