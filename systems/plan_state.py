"""The plan's present sample as vectors, for logging and for scores."""

from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from loco_drake.control.plan import standing_plan
from loco_drake.models.robots import Robot


class PlanState(LeafSystem):
    """Outputs the state that the plan wants now, and the plan time that has passed.

    .. pydrake_system::

        name: PlanState
        input_ports:
        - plan
        output_ports:
        - state
        - path_time

    ``state`` is [q, v] in the plant's order; ``path_time`` is in s.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        size = 13 + 2 * len(robot.joint_names)
        self._size = size
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))
        tickets = {self.time_ticket(), self._plan.ticket()}
        self.DeclareVectorOutputPort(
            "state", size, self._calc_state, prerequisites_of_calc=tickets
        )
        self.DeclareVectorOutputPort(
            "path_time", 1, self._calc_path_time, prerequisites_of_calc=tickets
        )

    def _calc_state(self, context: Context, output: Any) -> None:
        plan = self._plan.Eval(context)
        output.set_value(plan.state[plan.index(context.get_time())])

    def _calc_path_time(self, context: Context, output: Any) -> None:
        plan = self._plan.Eval(context)
        output[0] = plan.path_time[plan.index(context.get_time())]
