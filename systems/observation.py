"""What the policy sees: the robot's state and the plan relative to it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.gaits import ONE_HOT, ONE_HOT_SIZE
from loco_drake.models.robots import Robot
from loco_drake.rotations import (
    heading_matrix,
    quat_conjugate,
    quat_log,
    quat_multiply,
    quat_to_matrix,
)

from .plan import Plan, standing_plan

Array = NDArray[np.float64]

# Samples of the plan after the present one that are shown to the policy.
LOOK_AHEAD = np.array([1, 2, 4, 8])
_K = len(LOOK_AHEAD)

# Name and size of each part, in order; weights of a policy record this layout. H is
# the base's heading frame: at the base, z up, x along the base's x in the plane.
OBSERVATION_LAYOUT = (
    ("gravity_B", 3),  # direction of gravity
    ("w_WB_B", 3),  # rad/s
    ("v_WB_H", 3),  # m/s
    ("height", 1),  # z of the base, m
    ("joint_positions", 12),  # from the standing pose, rad
    ("joint_velocities", 12),  # a tenth of rad/s
    ("last_action", 12),
    ("plan_joint_velocities", 12),  # of the next sample, a tenth of rad/s
    ("plan_joints", 12 * _K),  # plan minus robot, rad
    ("plan_p_H", 3 * _K),  # base position of the plan from the robot's, m
    ("plan_R_B", 3 * _K),  # base rotation of the plan from the robot's, so(3), rad
    ("plan_v_H", 3 * _K),  # base velocity of the plan, m/s
    ("plan_w_H", 3 * _K),  # base angular velocity of the plan, rad/s
    ("plan_contacts", 4 * _K),
    ("label", ONE_HOT_SIZE),  # one-hot of the source, one-hot of the gait
)
OBSERVATION_SIZE = sum(size for _, size in OBSERVATION_LAYOUT)


def observe(
    robot: Robot, plan: Plan, time: float, state: Array, action: Array
) -> Array:
    """Returns the observation, shape (OBSERVATION_SIZE,).

    Args:
        robot: the robot.
        plan: what it is to do.
        time: context time in s.
        state: the plant's [q, v], as in :class:`Plan`.
        action: the action being applied, shape (J,).
    """
    joints = len(robot.joint_names)
    q, v = state[: 7 + joints], state[7 + joints :]
    now = plan.index(time)
    k = np.minimum(now + LOOK_AHEAD, len(plan) - 1)
    plan_q, plan_v = plan.q[k], plan.v[k]

    R_WB = quat_to_matrix(q[:4])
    # Row vectors times R_WH are vectors expressed in H.
    R_WH = heading_matrix(R_WB)
    R_BP = quat_log(quat_multiply(quat_conjugate(q[:4]), plan_q[:, :4]))
    return np.concatenate(
        (
            -R_WB[2],
            v[:3] @ R_WB,
            v[3:6] @ R_WH,
            q[6:7],
            q[7:] - robot.stand_joints,
            0.1 * v[6:],
            action,
            0.1 * plan_v[0, 6:],
            (plan_q[:, 7:] - q[7:]).ravel(),
            ((plan_q[:, 4:7] - q[4:7]) @ R_WH).ravel(),
            R_BP.ravel(),
            (plan_v[:, 3:6] @ R_WH).ravel(),
            (plan_v[:, :3] @ R_WH).ravel(),
            plan.contacts[k].ravel(),
            ONE_HOT[plan.labels[now]],
        )
    )


class Observation(LeafSystem):
    """Computes :func:`observe` from its inputs.

    .. pydrake_system::

        name: Observation
        input_ports:
        - plan
        - state
        - action
        output_ports:
        - observation
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._robot = robot
        joints = len(robot.joint_names)
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * joints)
        self._action = self.DeclareVectorInputPort("action", joints)
        self.DeclareVectorOutputPort(
            "observation",
            OBSERVATION_SIZE,
            self._calc,
            prerequisites_of_calc={
                self.time_ticket(),
                self._plan.ticket(),
                self._state.ticket(),
                self._action.ticket(),
            },
        )

    def _calc(self, context: Context, output: Any) -> None:
        output.set_value(
            observe(
                self._robot,
                self._plan.Eval(context),
                context.get_time(),
                self._state.Eval(context),
                self._action.Eval(context),
            )
        )
