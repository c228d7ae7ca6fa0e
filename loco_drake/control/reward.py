"""The reward for tracking a plan, per step."""

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import heading_matrix, quat_error, quat_to_matrix
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    JOINT_VELOCITIES,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
    split,
)
from loco_drake.models.simulated import SimulatedRobot

# Terms and weights of Peng et al. 2020, "Learning agile robotic locomotion skills by
# imitating animals", Section IV-B.
REWARD_TERMS = ("joints", "joint_velocities", "toes", "base_pose", "base_velocity")
REWARD_WEIGHTS = np.array([0.5, 0.05, 0.2, 0.15, 0.1])
_JOINTS = 12  # of the robot whose errors are summed up


def reward_terms(
    robot: SimulatedRobot, plan_state: Array, plan_p_BoF_H: Array, state: Array
) -> Array:
    """Returns the five weighted terms of the reward, (..., 5); their sum is at most 1.

    With e the sum of squared errors in rad, m and s, over the joints twelve times the
    mean, which of a robot with twelve joints is the sum:

    - joints: .5 exp(-5 e)
    - joint velocities: .05 exp(-.1 e)
    - toes: .2 exp(-40 e), contact points relative to the base, each in the heading
      frame of its own base
    - base pose: .15 exp(-20 e_p - 10 e_R), p_WB in the world, the rotation in so(3)
    - base velocity: .1 exp(-2 e_v - .2 e_w), in the world

    States (..., 13 + 2 J) are [q, v] with unit quaternions, ``plan_p_BoF_H`` (..., 4,
    3) is as :attr:`Plan.p_BoF_H`.
    """
    residuals = reward_residuals(robot, plan_state, plan_p_BoF_H, state)
    exponents = np.stack([_squares(part) for part in residuals], axis=-1)
    return REWARD_WEIGHTS * np.exp(-exponents)


def reward_residuals(
    robot: SimulatedRobot, plan_state: Array, plan_p_BoF_H: Array, state: Array
) -> tuple[Array, ...]:
    """Returns what the terms square: their exponents are minus the sums of squares.

    Arguments are those of :func:`reward_terms`; the shapes are (..., J), (..., J),
    (..., 12), (..., 6) and (..., 6).
    """
    (q, v), (plan_q, plan_v) = split(state), split(plan_state)
    R_WB = quat_to_matrix(q[ORIENTATION])
    p_BoF_H = robot.contact_points(q[JOINTS]) @ (
        np.swapaxes(R_WB, -1, -2) @ heading_matrix(R_WB)
    )
    gap, velocity, toes = q - plan_q, v - plan_v, p_BoF_H - plan_p_BoF_H
    turn = quat_error(plan_q[ORIENTATION], q[ORIENTATION])
    share = _JOINTS / len(robot.joint_names)
    return (
        np.sqrt(5 * share) * gap[JOINTS],
        np.sqrt(0.1 * share) * velocity[JOINT_VELOCITIES],
        np.sqrt(40.0) * toes.reshape(*toes.shape[:-2], 12),
        np.concatenate((np.sqrt(20.0) * gap[POSITION], np.sqrt(10.0) * turn), axis=-1),
        np.concatenate(
            (
                np.sqrt(2.0) * velocity[VELOCITY],
                np.sqrt(0.2) * velocity[ANGULAR_VELOCITY],
            ),
            axis=-1,
        ),
    )


def _squares(error: Array) -> Array:
    """Returns the sum of squares over the last axis."""
    return np.einsum("...i,...i->...", error, error)
