"""Many robots that follow plans, each in a Context of one diagram."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from loco_drake.models.plant import ConfigureSimulator, PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.domain import Domain, SetDomain
from loco_drake.systems.observation import LOOK_AHEAD, Preview, observe
from loco_drake.systems.plan import PLAN_DT, Plan
from loco_drake.systems.scenario import (
    Disturbances,
    ExternalAction,
    PlanReference,
    Scenario,
)
from loco_drake.systems.sensors import draw_error, measure
from loco_drake.systems.tracking_reward import reward_terms
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.terminations import is_lost

Array = NDArray[np.float64]


@lru_cache(maxsize=4)
def _diagram(
    robot: str,
    contact: str,
    time_step: float,
    friction: float,
    disturbances: Disturbances,
) -> Diagram:
    # One per process: pydrake never frees diagrams with Python systems.
    plant = PlantConfig(contact=contact, time_step=time_step, friction=friction)
    return MakeLocomotionDiagram(
        Scenario(
            robot=robot,
            plant=plant,
            reference=PlanReference(),
            smoother=None,
            policy=ExternalAction(),
            disturbances=disturbances,
        )
    )


class _Robot:
    """One robot: a Context of the diagram, and the simulator that advances it."""

    def __init__(self, diagram: Diagram, plant: PlantConfig) -> None:
        self._diagram = diagram
        self._simulator = Simulator(diagram, diagram.CreateDefaultContext())
        ConfigureSimulator(self._simulator, plant)
        self._context = self._simulator.get_mutable_context()
        self._plant = diagram.GetSubsystemByName("plant")
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        self._player = diagram.GetSubsystemByName("reference")
        self._player_context = self._player.GetMyMutableContextFromRoot(self._context)
        self._stateful = [
            (system, system.GetMyMutableContextFromRoot(self._context))
            for name in ("joint_targets", "actuation")
            if diagram.HasSubsystemNamed(name)
            for system in (diagram.GetSubsystemByName(name),)
        ]
        action = diagram.GetInputPort("action").FixValue(self._context, np.zeros(12))
        self._action = action.GetMutableData()

    def reset(self, plan: Plan, sample: int, state: Array, domain: Domain) -> None:
        """Puts the robot in ``state``, at a sample of the plan that it is to follow."""
        # What is set here is all the state there is.
        for system, context in self._stateful:
            system.SetDefaultContext(context)
        SetDomain(self._diagram, self._context, domain)
        self._context.SetTime(sample * PLAN_DT)
        self._player.SetPlan(self._player_context, plan)
        self._plant.SetPositionsAndVelocities(self._plant_context, state)
        self._simulator.Initialize()

    def advance(self, action: Array, sample: int) -> Array:
        """Simulates until the time of ``sample``; returns the state [q, v], (37,)."""
        self._action.get_mutable_value().set_value(action)
        self._simulator.AdvanceTo(sample * PLAN_DT, interruptible=False)
        return np.asarray(self._plant.GetPositionsAndVelocities(self._plant_context))


class TrackingBatch:
    """B robots that follow plans, one control period at a time.

    What is computed from the states, observations, rewards and terminations, is
    computed for all robots at once, by the functions that the systems of the same names
    use: for one robot alone it would cost as much as the physics.

    Args:
        plans: what to follow.
        config: of each environment.
        count: B, the number of robots.

    Attributes:
        plan: index of the plan that each robot follows, shape (B,).
        start: sample of its plan that each robot started at, shape (B,).
        sample: sample of its plan that each robot is at, shape (B,).
    """

    def __init__(
        self, plans: list[Plan], config: EnvironmentConfig, count: int
    ) -> None:
        self._plans = plans
        self._config = config
        self._robot = get_robot(config.robot)
        plant = config.plant
        config.randomization.check()
        diagram = _diagram(
            config.robot,
            plant.contact,
            plant.time_step,
            plant.friction,
            config.randomization.disturbances,
        )
        self._robots = [_Robot(diagram, plant) for _ in range(count)]
        self._lengths = np.array([len(plan) for plan in plans])
        # All samples of all plans, one after the other, for one look-up a step.
        self._first = np.cumsum(self._lengths) - self._lengths
        self._wanted = np.concatenate([plan.state for plan in plans])
        self._toes = np.concatenate([plan.p_BoF_H for plan in plans])
        self._contacts = np.concatenate([plan.contacts for plan in plans])
        self._labels = np.concatenate([plan.labels for plan in plans])
        self.plan = np.zeros(count, dtype=np.int64)
        self.start = np.zeros(count, dtype=np.int64)
        self.sample = np.zeros(count, dtype=np.int64)
        self._last = np.zeros(count, dtype=np.int64)
        self._state = np.zeros((count, 37))
        self._action = np.zeros((count, 12))
        self._domains = [Domain()] * count

    def reset(
        self,
        i: int,
        random: np.random.Generator,
        plan: int | None = None,
        sample: int | None = None,
    ) -> None:
        """Starts an episode of robot ``i``.

        Args:
            i: which robot.
            random: draws what is not given, and the noise.
            plan: index of the plan to follow.
            sample: where in it to start. By default anywhere that leaves half an
                episode, where the plan is that long.
        """
        if plan is None:
            plan = int(random.integers(len(self._plans)))
        length = int(self._lengths[plan])
        steps = self._config.episode_steps
        if sample is None:
            sample = int(random.integers(max(1, length - steps // 2)))
        self.plan[i], self.start[i], self.sample[i] = plan, sample, sample
        self._last[i] = min(sample + steps, length - 1)
        followed = self._plans[plan]
        state = self._config.reset_noise.draw(followed.state[sample], random)
        self._domains[i] = self._config.randomization.draw(
            self._robot, random, sample * PLAN_DT, self._last[i] * PLAN_DT
        )
        self._robots[i].reset(followed, sample, state, self._domains[i])
        self._state[i], self._action[i] = state, 0.0

    def step(
        self, actions: NDArray[np.floating]
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Advances every robot by one control period.

        Args:
            actions: shape (B, 12).

        Returns:
            The reward's terms (B, 5), and who terminated and who is truncated, (B,).
        """
        self._action[:] = actions
        self.sample += 1
        for i, robot in enumerate(self._robots):
            self._state[i] = robot.advance(self._action[i], int(self.sample[i]))
        now = self._first[self.plan] + self.sample
        wanted, toes = self._wanted[now], self._toes[now]
        terms = reward_terms(self._robot, wanted, toes, self._state)
        lost = is_lost(self._robot, self._config.termination, self._state, wanted)
        return terms, lost, ~lost & (self.sample >= self._last)

    def observe(self) -> NDArray[np.float32]:
        """Returns the observations of all robots, shape (B, OBSERVATION_SIZE)."""
        first, last = self._first[self.plan], self._lengths[self.plan] - 1
        ahead = np.minimum(self.sample[:, None] + LOOK_AHEAD, last[:, None])
        rows = first[:, None] + ahead
        shown = Preview(
            q=self._wanted[rows, :19],
            v=self._wanted[rows, 19:],
            contacts=self._contacts[rows],
            label=self._labels[first + self.sample],
        )
        observations = observe(self._robot, shown, self._measured(), self._action)
        return observations.astype(np.float32)

    def _measured(self) -> Array:
        """Returns the states as the robots measure them, shape (B, 37)."""
        errors = [
            draw_error(domain.sensors, int(sample))
            for domain, sample in zip(self._domains, self.sample, strict=True)
            if domain.sensors is not None
        ]
        return measure(self._state, np.array(errors)) if errors else self._state
