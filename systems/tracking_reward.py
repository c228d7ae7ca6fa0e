"""The system that says how well the robot follows its plan."""

from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.control.plan import standing_plan
from loco_drake.control.reward import REWARD_TERMS, reward_terms
from loco_drake.models.robots import Robot


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
        plan = self._plan.Eval(context)
        k = plan.index(context.get_time())
        output.set_value(
            reward_terms(
                self._robot,
                plan.state[k],
                plan.p_BoF_H[k],
                self._state.Eval(context),
            )
        )
