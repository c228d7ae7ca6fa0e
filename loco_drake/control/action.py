"""PD set-points from plan and action."""

from functools import lru_cache

import numpy as np

from loco_drake.common.arrays import Array, read_only
from loco_drake.control.feed_forward import feed_forward_torques, mid_samples
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.control.state import JOINT_VELOCITIES, JOINTS
from loco_drake.models.simulated import SimulatedRobot

ACTION_SCALE = 0.15  # rad per unit of action: 15 Nm on Go2 and A1


def joint_targets(set_points: Array, action: Array) -> Array:
    """Returns the desired state of the PD, [q_d, v_d], shape (..., 2 J).

    q_d = set_points + ACTION_SCALE * action, and v_d = 0. The set-points contain the
    desired velocity, because Drake's CENIC integrator (1.51) applies v_d with the wrong
    sign. The torque of the PD is the same. ``set_points`` (..., J), rad, are
    :func:`set_points` at the end of the control period; ``action`` is (..., J).
    """
    q_d = set_points + ACTION_SCALE * action
    return np.concatenate((q_d, np.zeros_like(q_d)), axis=-1)


@lru_cache(maxsize=4)  # A plan is immutable.
def set_points(robot: SimulatedRobot, plan: Plan) -> Array:
    """Returns the PD set-points that track ``plan``, rad, shape (N, J).

    Row k is held for the control period that ends at sample k. In it the PD is to
    apply, on average, the torques tau of :func:`feed_forward_torques`. With the mean
    velocity v of the period they are q + (d v + tau) / kp with d =
    :func:`velocity_gain`.
    """
    _, v, _ = mid_samples(plan)
    ahead = velocity_gain(robot) * v[JOINT_VELOCITIES]
    ahead = ahead + feed_forward_torques(robot, plan)
    return read_only(plan.q[JOINTS] + ahead / robot.kp)


def velocity_gain(robot: SimulatedRobot) -> Array:
    """Returns the gain of planned joint velocities, N m s/rad, shape (J,).

    kd v makes up for the damping of the motors. A set-point is held for a control
    period T and belongs to its end, so it is T / 2 ahead of the joints on average, and
    T / 2 kp v of that torque is there already: the gain is kd - T / 2 kp.
    """
    return robot.kd - PLAN_DT / 2 * robot.kp
