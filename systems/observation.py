"""The system that computes what the policy sees."""

from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.control.observation import OBSERVATION_SIZE, observe, preview
from loco_drake.control.plan import standing_plan
from loco_drake.models.robots import Robot


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
                preview(self._plan.Eval(context), context.get_time()),
                self._state.Eval(context),
                self._action.Eval(context),
            )
        )
