"""PD set-points from plan and action."""

from functools import lru_cache

import numpy as np

from loco_drake.common.arrays import Array, read_only
from loco_drake.common.gravity import GRAVITY
from loco_drake.common.rotations import quat_conjugate, quat_rotate
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.control.state import JOINT_VELOCITIES, JOINTS, ORIENTATION, VELOCITY
from loco_drake.models.robots import Robot

ACTION_SCALE = 0.15  # rad per unit of action: 15 Nm on both robots
MAX_LOAD = 2.5  # robot weights


def joint_targets(set_points: Array, action: Array) -> Array:
    """Returns the desired state of the PD, [q_d, v_d], shape (..., 2 J).

    q_d = set_points + ACTION_SCALE * action, and v_d = 0. The set-points contain the
    desired velocity, because Drake's CENIC integrator (1.51) applies v_d with the wrong
    sign. The torque of the PD is the same. ``set_points`` (..., J), rad, are
    :func:`set_points` at the end of the control period; ``action`` is (..., J).
    """
    q_d = set_points + ACTION_SCALE * action
    return np.concatenate((q_d, np.zeros_like(q_d)), axis=-1)


@lru_cache(maxsize=4)  # A plan is immutable, and sampled at 50 Hz.
def set_points(robot: Robot, plan: Plan) -> Array:
    """Returns the PD set-points that track ``plan``, rad, shape (N, J).

    They are q + (d v + tau) / kp with the torques tau of :func:`feed_forward_torques`
    and d = :func:`velocity_gain`.
    """
    torques = feed_forward_torques(robot, plan)
    ahead = (velocity_gain(robot) * plan.v[JOINT_VELOCITIES] + torques) / robot.kp
    return read_only(plan.q[JOINTS] + ahead)


def velocity_gain(robot: Robot) -> Array:
    """Returns the gain of planned joint velocities, N m s/rad, shape (12,).

    kd v makes up for the damping of the motors. A set-point is held for a control
    period T and belongs to its end, so it is T / 2 ahead of the joints on average, and
    T / 2 kp v of that torque is there already: the gain is kd - T / 2 kp.
    """
    return robot.kd - PLAN_DT / 2 * robot.kp


def feed_forward_torques(robot: Robot, plan: Plan) -> Array:
    """Returns approximate joint torques of a plan, N m, shape (N, J).

    The feet in contact share the vertical force m (g + a), where a is the base's
    planned acceleration, equally. The joints balance this force, tau = -J^T f, and
    accelerate their own inertia in the standing pose. The weight and coupling of the
    legs are neglected. Such a feed-forward reduces the samples that a tracker needs
    (Fuchioka et al. 2023, OPT-Mimic).
    """
    contacts = plan.contacts
    load = np.clip(1 + plan.vdot[VELOCITY][:, 2] / GRAVITY, 0.0, MAX_LOAD)
    share = contacts / np.maximum(contacts.sum(axis=1, keepdims=True), 1)
    force = robot.mass * GRAVITY * load[:, None] * share  # (N, 4)
    up_B = quat_rotate(quat_conjugate(plan.q[ORIENTATION]), np.array([0.0, 0.0, 1.0]))
    # (N, 4, 3 rows x y z, 3 joints) against (N, 3)
    lift = np.einsum("nlij,ni->nlj", robot.toe_jacobians(plan.q[JOINTS]), up_B)
    support = (-force[..., None] * lift).reshape(len(plan), -1)
    return support + robot.joint_inertia * plan.vdot[JOINT_VELOCITIES]
