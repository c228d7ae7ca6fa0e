"""The system that outputs a plan made beforehand."""

from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import AbstractParameterIndex, Context, LeafSystem

from loco_drake.control.plan import Plan, standing_plan
from loco_drake.models.robots import Robot


class PlanPlayer(LeafSystem):
    """Outputs the plan that is set in its Context.

    .. pydrake_system::

        name: PlanPlayer
        output_ports:
        - plan: abstract, Plan

    The plan is an abstract parameter: constant during a simulation, and set for each
    episode with :meth:`SetPlan`.

    Args:
        robot: the robot.
        plan: the plan in a default Context; by default the robot stands.
    """

    def __init__(self, robot: Robot, plan: Plan | None = None) -> None:
        super().__init__()
        rest = standing_plan(robot)
        self._plan = AbstractParameterIndex(
            self.DeclareAbstractParameter(Value(plan or rest))
        )
        self.DeclareAbstractOutputPort(
            "plan",
            lambda: Value(rest),
            self._calc_plan,
            prerequisites_of_calc={self.abstract_parameter_ticket(self._plan)},
        )

    def SetPlan(self, context: Context, plan: Plan) -> None:
        """Sets the plan to play in ``context``, which is this system's own."""
        context.get_mutable_abstract_parameter(self._plan).set_value(plan)

    def _calc_plan(self, context: Context, output: AbstractValue) -> None:
        output.set_value(context.get_abstract_parameter(self._plan).get_value())
