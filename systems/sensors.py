"""The system that adds the errors of sensors to the robot's state."""

from typing import Any

from pydrake.systems.framework import Context

from loco_drake.control.measurement import draw_error, measure
from loco_drake.control.plan import PLAN_DT
from loco_drake.models.robots import Robot

from .domain import DomainSystem

_TOLERANCE = 1e-6  # of a sample; context times are sums of steps


class Sensors(DomainSystem):
    """Outputs the state with the errors of its domain, new ones every PLAN_DT.

    .. pydrake_system::

        name: Sensors
        input_ports:
        - state
        output_ports:
        - state
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        size = 13 + 2 * len(robot.joint_names)
        self._state = self.DeclareVectorInputPort("state", size)
        self.DeclareVectorOutputPort(
            "state",
            size,
            self._calc,
            prerequisites_of_calc={
                self.time_ticket(),
                self._state.ticket(),
                self._domain_ticket,
            },
        )

    def _calc(self, context: Context, output: Any) -> None:
        state = self._state.Eval(context)
        errors = self._domain(context).sensors
        if errors is not None:
            sample = int(context.get_time() / PLAN_DT + _TOLERANCE)
            state = measure(state, draw_error(errors, sample))
        output.set_value(state)
