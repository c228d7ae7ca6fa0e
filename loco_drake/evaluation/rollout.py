"""Simulations whose outcome is kept, and what they look like in Meshcat."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus
from pydrake.systems.primitives import LogVectorOutput

from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import has_fallen, unit_base
from loco_drake.evaluation.tracking import Rollout
from loco_drake.systems.diagram import AddLocomotion
from loco_drake.systems.scenario import Scenario
from loco_drake.systems.simulator import MakeSimulator, StartEpisode

# Enough for smooth motion; every picture more makes a saved page larger.
FRAMES_PER_SECOND = 32.0

_LOGGED = ("state", "plan_state", "path_time", "desired_state", "reward_terms")


class Recorder:
    """The locomotion diagram with logs of its ports, for any number of episodes.

    Args:
        scenario: what to simulate.
        meshcat: where to draw it, if anywhere.

    Attributes:
        diagram: has the ports of a locomotion diagram.
        simulator: of ``diagram``.
    """

    def __init__(self, scenario: Scenario, meshcat: Meshcat | None = None) -> None:
        builder = DiagramBuilder()
        self._made = AddLocomotion(builder, scenario, meshcat=meshcat)
        self._logs = [
            LogVectorOutput(self._made.outputs[name], builder, publish_period=PLAN_DT)
            for name in _LOGGED
        ]
        self._made.ExportPorts(builder)
        self.diagram = builder.Build()
        self.simulator = MakeSimulator(self.diagram, scenario)
        self.simulator.set_monitor(self._monitor)
        self._fell = False

    @property
    def context(self) -> Context:
        """The diagram's context."""
        return self.simulator.get_mutable_context()

    def start(self, **episode: Any) -> None:
        """Starts an episode, see :func:`StartEpisode`; forgets what was recorded."""
        for log in self._logs:
            log.FindMutableLog(self.context).Clear()
        StartEpisode(self.simulator, **episode)
        self._fell = False

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
        wall, done = 0.0, 0
        while done < steps and not self._fell:
            start = time.perf_counter()
            self.simulator.AdvanceTo((done + 1) * PLAN_DT)
            wall += time.perf_counter() - start
            if not self._fell:
                done += 1
                if after_step is not None:
                    after_step(done * PLAN_DT)
        # Copies, since the logs are cleared. A sample at the moment of a fall is left
        # out: its step was lost.
        state, plan_state, path_time, desired_state, reward_terms = (
            log.FindLog(self.context).data().T[: done + 1].copy() for log in self._logs
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

    def _monitor(self, root: Context) -> EventStatus:
        plant, instance = self._made.plant, self._made.instance
        q = plant.GetPositions(plant.GetMyContextFromRoot(root), instance)
        if has_fallen(self._made.robot, unit_base(np.asarray(q))):
            self._fell = True
            return EventStatus.ReachedTermination(plant, "the robot fell")
        return EventStatus.DidNothing()


def dress(meshcat: Meshcat) -> None:
    """Gives the scene its sky, and a camera at the start."""
    meshcat.SetProperty("/Background", "top_color", [0.75, 0.83, 0.92])
    # These would be drawn through the floor.
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetCameraPose([1.5, -2.5, 1.0], [1.0, 0.0, 0.3])


def frame(meshcat: Meshcat, p_WB: NDArray[np.float64]) -> None:
    """Puts the camera where all of the base's path, shape (N, 3), can be seen."""
    middle = (p_WB.min(axis=0) + p_WB.max(axis=0)) / 2
    along = p_WB[-1, :2] - p_WB[0, :2]
    length = float(np.hypot(*along))
    side = np.array([along[1], -along[0]]) / max(length, 1e-9)
    away = max(1.8, 0.6 * length)
    eye = [*(middle[:2] + away * side), 0.3 + 0.4 * away]
    meshcat.SetCameraPose(eye, [*middle[:2], 0.25])
