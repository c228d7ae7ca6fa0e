"""The plan of a scenario, recorded without a robot."""

from typing import Any

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.control.plan import PLAN_DT, UPDATE_PERIOD, Plan, join_plans
from loco_drake.models.robots import get_robot

from .diagram import AddPlan
from .scenario import Scenario
from .simulator import SetReference


class PlanRecorder:
    """Records what reference and smoother of a ``scenario`` output, as one plan.

    They depend on time alone, so the plan is the one that a robot tracks in the whole
    diagram, to the last bit. One recorder serves for any number of episodes.

    Raises:
        InputError: if the scenario is invalid.
    """

    def __init__(self, scenario: Scenario) -> None:
        scenario.check()
        builder = DiagramBuilder()
        _, outputs = AddPlan(builder, get_robot(scenario.robot), scenario)
        self._plan = outputs["plan"]
        self._diagram = builder.Build()
        self._simulator = Simulator(self._diagram)

    def record(self, duration: float, **reference: Any) -> Plan:
        """Returns the plan from time 0 to ``duration``, s, and what follows it so far.

        Gait, seed or plan replace those of the scenario's reference, see
        :func:`.simulator.StartEpisode`. A plan must not end before ``duration``.
        """
        context = self._simulator.get_mutable_context()
        self._diagram.SetDefaultContext(context)
        context.SetTime(0.0)
        SetReference(self._diagram, context, **reference)
        self._simulator.Initialize()
        recorded = self._now()
        for k in range(1, round(duration / UPDATE_PERIOD) + 1):
            self._simulator.AdvanceTo(k * UPDATE_PERIOD)
            now = self._now()
            # What has been played is final.
            first = round((now.start_time - recorded.start_time) / PLAN_DT)
            played = recorded.index(context.get_time())
            if played > first:
                now = now.slice(played - first)
            if played > 0:
                now = join_plans(recorded.slice(0, played), now)
            recorded = now
        return recorded

    def _now(self) -> Plan:
        owner = self._plan.get_system()
        context = owner.GetMyContextFromRoot(self._simulator.get_context())
        plan: Plan = self._plan.Eval(context)
        return plan
