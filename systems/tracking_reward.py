"""How well the robot does what the plan says, one number a step."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.models.kinematics import toe_positions
from loco_drake.models.robots import Robot
from loco_drake.rotations import (
    quat_error,
    quat_multiply,
    quat_rotate,
    yaw_of,
    yaw_quat,
)

from .plan import Plan, standing_plan

Array = NDArray[np.float64]

# Name, weight, and what is scaled in the exponent: Peng et al. 2020, "Learning agile
# robotic locomotion skills by imitating animals", Section IV-B.
REWARD_TERMS = ("joints", "joint_velocities", "toes", "base_pose", "base_velocity")
REWARD_WEIGHTS = np.array([0.5, 0.05, 0.2, 0.15, 0.1])


def reward_terms(robot: Robot, plan: Plan, time: float, state: Array) -> Array:
    """Returns the five terms of the reward, weighted; their sum is at most 1.

    With e the sum of squared errors, in rad, m and s:

    - joints: .5 exp(-5 e)
    - joint velocities: .05 exp(-.1 e)
    - toes: .2 exp(-40 e), sphere centres relative to the base, each in the heading
      frame of its own base
    - base pose: .15 exp(-20 e_p - 10 e_R), p_WB in the world, the rotation in so(3)
    - base velocity: .1 exp(-2 e_v - .2 e_w), in the world

    Args:
        robot: the robot.
        plan: what it is to do.
        time: context time in s.
        state: the plant's [q, v], as in :class:`Plan`.
    """
    joints = len(robot.joint_names)
    q, v = state[: 7 + joints], state[7 + joints :]
    k = plan.index(time)
    plan_q, plan_v = plan.q[k], plan.v[k]

    base_q = np.stack((q[:4], plan_q[:4]))
    p_BF = toe_positions(robot, np.stack((q[7:], plan_q[7:])))
    q_HB = _tilt(base_q)
    p_HF = quat_rotate(q_HB[:, None], p_BF)

    def squares(error: Array) -> float:
        return float(np.dot(error, error))

    exponents = np.array(
        [
            5 * squares(q[7:] - plan_q[7:]),
            0.1 * squares(v[6:] - plan_v[6:]),
            40 * squares((p_HF[0] - p_HF[1]).ravel()),
            20 * squares(q[4:7] - plan_q[4:7])
            + 10 * squares(quat_error(base_q[0], base_q[1])),
            2 * squares(v[3:6] - plan_v[3:6]) + 0.2 * squares(v[:3] - plan_v[:3]),
        ]
    )
    return REWARD_WEIGHTS * np.exp(-exponents)


def _tilt(q_WB: Array) -> Array:
    """Returns R_HB, the rotation of the base but for its heading."""
    return quat_multiply(yaw_quat(-yaw_of(q_WB)), q_WB)


class TrackingReward(LeafSystem):
    """Computes :func:`reward_terms` from its inputs.

    .. pydrake_system::

        name: TrackingReward
        input_ports:
        - plan
        - state
        output_ports:
        - reward_terms
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._robot = robot
        joints = len(robot.joint_names)
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * joints)
        self.DeclareVectorOutputPort(
            "reward_terms",
            len(REWARD_TERMS),
            self._calc,
            prerequisites_of_calc={
                self.time_ticket(),
                self._plan.ticket(),
                self._state.ticket(),
            },
        )

    def _calc(self, context: Context, output: Any) -> None:
        output.set_value(
            reward_terms(
                self._robot,
                self._plan.Eval(context),
                context.get_time(),
                self._state.Eval(context),
            )
        )
