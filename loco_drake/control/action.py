"""From plan and action to the set-points of the joints' PD controllers."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_conjugate, quat_rotate
from loco_drake.control.plan import Plan
from loco_drake.control.state import (
    JOINT_VELOCITIES,
    JOINTS,
    ORIENTATION,
    VELOCITY,
)
from loco_drake.models.robots import Robot

Array = NDArray[np.float64]

ACTION_SCALE = 0.15  # rad per unit of action: 15 Nm on both robots
GRAVITY = 9.81  # m/s^2
_MAX_LOAD = 2.5  # robot weights


def joint_targets(set_points: Array, action: Array) -> Array:
    """Returns what the PD is sent, [q_d, v_d], shape (..., 2 J).

    They are q_d = set_points + ACTION_SCALE * action and v_d = 0: the desired velocity
    is within the set-points, since Drake's CENIC integrator (1.51) takes it with the
    wrong sign; the torque kp (q_d - q) - kd v is the same either way.

    Args:
        set_points: of :func:`set_points` at the end of the control period, (..., J).
        action: the policy's, shape (..., J).
    """
    q_d = set_points + ACTION_SCALE * action
    return np.concatenate((q_d, np.zeros_like(q_d)), axis=-1)


@lru_cache(maxsize=4)  # A plan is immutable, and sampled fifty times a second.
def set_points(robot: Robot, plan: Plan) -> Array:
    """Returns the set-points of the PD that follow ``plan``, rad, shape (N, J).

    They are q + (kd v + tau) / kp, with the gains of the PD and the torques tau of
    :func:`feed_forward_torques`: all act through the position.
    """
    torques = feed_forward_torques(robot, plan)
    points = plan.q[JOINTS] + (robot.kd * plan.v[JOINT_VELOCITIES] + torques) / robot.kp
    points.setflags(write=False)
    return points


def feed_forward_torques(robot: Robot, plan: Plan) -> Array:
    """Returns joint torques (N, J) in Nm that a plan takes, roughly.

    The feet in contact share equally the vertical force m (g + a) that the planned
    acceleration a of the base asks for, and the joints balance it: tau = -J^T f. To
    this comes what accelerates each joint, with its inertia in the usual stance; the
    legs' weight and their coupling are left out. A feed-forward of this kind is what
    lets trackers learn from few samples (Fuchioka et al. 2023, OPT-Mimic): it spares
    the policy from having to learn first that robots have mass.
    """
    contacts = plan.contacts
    load = np.clip(1 + plan.vdot[VELOCITY][:, 2] / GRAVITY, 0.0, _MAX_LOAD)
    share = contacts / np.maximum(contacts.sum(axis=1, keepdims=True), 1)
    force = robot.mass * GRAVITY * load[:, None] * share  # (N, 4)
    up_B = quat_rotate(quat_conjugate(plan.q[ORIENTATION]), np.array([0.0, 0.0, 1.0]))
    # (N, 4, 3 rows x y z, 3 joints) against (N, 3)
    lift = np.einsum("nlij,ni->nlj", robot.toe_jacobians(plan.q[JOINTS]), up_B)
    support = (-force[..., None] * lift).reshape(len(plan), -1)
    return support + robot.joint_inertia * plan.vdot[JOINT_VELOCITIES]
