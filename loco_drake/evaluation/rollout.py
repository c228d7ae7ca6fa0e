"""Simulations whose outcome is kept."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from loco_drake.control.domain import Domain
from loco_drake.control.fall import has_fallen
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.evaluation.tracking import Rollout
from loco_drake.models.plant import ConfigureSimulator
from loco_drake.models.robots import get_robot
from loco_drake.systems.diagram import MakeLocomotionDiagram, StartOnPlan
from loco_drake.systems.domain import SetDomain
from loco_drake.systems.scenario import Scenario

_RECORDED = ("state", "plan_state", "path_time", "desired_state", "reward_terms")


class Recorder:
    """The locomotion diagram, to be simulated any number of times.

    Its output ports are read after every control period. There is no diagram around it
    with loggers: Drake's CENIC looks for the plant among the root's own systems.

    Args:
        scenario: what to simulate.
        meshcat: where to draw it, if anywhere.

    Attributes:
        diagram: the locomotion diagram.
        simulator: of ``diagram``.
    """

    def __init__(self, scenario: Scenario, meshcat: Meshcat | None = None) -> None:
        self._robot = get_robot(scenario.robot)
        self.diagram = MakeLocomotionDiagram(scenario, meshcat=meshcat)
        self.simulator = Simulator(self.diagram)
        ConfigureSimulator(self.simulator, scenario.plant)
        self._ports = [self.diagram.GetOutputPort(name) for name in _RECORDED]
        self._plant = self.diagram.GetSubsystemByName("plant")
        self._samples: list[list[NDArray[np.float64]]] = []
        self._fell = False

    @property
    def context(self) -> Context:
        """The diagram's context."""
        return self.simulator.get_mutable_context()

    def start(
        self,
        *,
        gait: str | None = None,
        seed: int = 0,
        plan: Plan | None = None,
        domain: Domain | None = None,
    ) -> None:
        """Puts the clock to 0, the robot on its plan and forgets what was recorded.

        Args:
            gait: of a generated reference, instead of the scenario's.
            seed: of a generated reference, used with ``gait``.
            plan: of a reference that is played, instead of the scenario's.
            domain: in what the world differs from the model; the scenario must have the
                disturbances for it.
        """
        self._fell = False
        self.simulator.clear_monitor()
        self.diagram.SetDefaultContext(self.context)
        self.context.SetTime(0.0)
        if domain is not None:
            SetDomain(self.diagram, self.context, domain)
        reference = self.diagram.GetSubsystemByName("reference")
        context = reference.GetMyMutableContextFromRoot(self.context)
        if gait is not None:
            reference.SetReference(context, gait=gait, seed=seed)
        if plan is not None:
            reference.SetPlan(context, plan)
        StartOnPlan(self.simulator)
        self._samples = [self._sample()]
        self.simulator.set_monitor(self._monitor)

    def run(
        self, duration: float, after_step: Callable[[float], None] | None = None
    ) -> tuple[Rollout, float]:
        """Simulates until ``duration`` or a fall; call :meth:`start` first.

        Args:
            duration: context time in s to stop at.
            after_step: called after each control period, with the context's time.

        Returns:
            What happened, and the seconds spent inside AdvanceTo.
        """
        steps = round(duration / PLAN_DT)
        wall = 0.0
        for step in range(1, steps + 1):
            start = time.perf_counter()
            self.simulator.AdvanceTo(step * PLAN_DT)
            wall += time.perf_counter() - start
            if self._fell:
                break
            self._samples.append(self._sample())
            if after_step is not None:
                after_step(step * PLAN_DT)
        state, plan_state, path_time, desired_state, reward_terms = (
            np.array(samples) for samples in zip(*self._samples, strict=True)
        )
        rollout = Rollout(
            state=state,
            plan_state=plan_state,
            path_time=path_time[:, 0],
            desired_joints=desired_state[:, :12],
            reward=reward_terms.sum(axis=1),
            steps=steps,
            fell=self._fell,
        )
        return rollout, wall

    def _sample(self) -> list[NDArray[np.float64]]:
        return [port.Eval(self.context) for port in self._ports]

    def _monitor(self, root: Context) -> EventStatus:
        context = self._plant.GetMyContextFromRoot(root)
        if has_fallen(self._robot, np.asarray(self._plant.GetPositions(context))):
            self._fell = True
            return EventStatus.ReachedTermination(self._plant, "the robot fell")
        return EventStatus.DidNothing()
