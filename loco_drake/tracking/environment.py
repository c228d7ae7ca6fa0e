"""The Gymnasium environment: the locomotion diagram with its action port open."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from loco_drake.models.plant import ConfigureSimulator, PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.rotations import quat_multiply, quat_rotate, yaw_quat
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.observation import OBSERVATION_SIZE
from loco_drake.systems.plan import PLAN_DT, Plan
from loco_drake.systems.scenario import ExternalAction, PlanReference, Scenario
from loco_drake.systems.tracking_reward import REWARD_TERMS
from loco_drake.tracking.terminations import TerminationConfig, is_lost

Array = NDArray[np.float64]
Observation = NDArray[np.float32]


@dataclass(kw_only=True)
class ResetNoise:
    """How far from the plan's state episodes start, as standard deviations.

    A robot that is moved off its plan at the start learns to come back to it: without
    that, a policy once pushed out of the plan's neighbourhood stays beside it.

    Attributes:
        joints: rad.
        velocities: of joints (rad/s) and base (rad/s and m/s).
        position: of the base along x and y, m.
        heading: of the base, rad; its velocity turns with it.
    """

    joints: float = 0.02
    velocities: float = 0.1
    position: float = 0.1
    heading: float = 0.1

    def draw(self, state: Array, random: np.random.Generator) -> Array:
        """Returns a state [q, v], as in Plan, near ``state``."""
        state = state.copy()
        turn = yaw_quat(self.heading * random.standard_normal(1))[0]
        state[:4] = quat_multiply(turn, state[:4])
        state[19:22] = quat_rotate(turn, state[19:22])
        state[22:25] = quat_rotate(turn, state[22:25])
        state[4:6] += self.position * random.standard_normal(2)
        state[7:19] += self.joints * random.standard_normal(12)
        state[19:] += self.velocities * random.standard_normal(18)
        return state


@dataclass(kw_only=True)
class EnvironmentConfig:
    """An environment, but for its plans.

    Attributes:
        robot: name of the robot.
        plant: contact, step and friction.
        termination: when an episode ends early.
        episode_steps: an episode is truncated after this many steps.
        reset_noise: how far from the plan's state episodes start.
    """

    robot: str = "go2"
    plant: PlantConfig = field(default_factory=PlantConfig)
    termination: TerminationConfig = field(default_factory=TerminationConfig)
    episode_steps: int = 200
    reset_noise: ResetNoise = field(default_factory=ResetNoise)


@lru_cache(maxsize=4)
def _diagram(robot: str, contact: str, time_step: float, friction: float) -> Diagram:
    # One per process: pydrake never frees diagrams with Python systems.
    plant = PlantConfig(contact=contact, time_step=time_step, friction=friction)
    return MakeLocomotionDiagram(
        Scenario(
            robot=robot,
            plant=plant,
            reference=PlanReference(),
            smoother=None,
            policy=ExternalAction(),
        )
    )


class TrackingEnv(gymnasium.Env[Observation, Observation]):
    """A robot that is to follow a plan, drawn at random for each episode.

    Observations are those of :mod:`loco_drake.systems.observation`, actions those of
    :class:`loco_drake.systems.joint_targets.JointTargets`, rewards the sum of
    :func:`loco_drake.systems.tracking_reward.reward_terms`, at most 1 a step. An
    episode starts in a state of the plan (reference state initialization, Peng et al.
    2018), terminates when the robot falls or loses its plan, and is truncated when its
    time or its plan is over.

    ``info`` holds the reward's terms by name, and the plan and sample that the episode
    started at. ``reset(options={"plan": i, "sample": k})`` chooses them.

    Args:
        plans: what to follow.
        config: everything else.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (as in Gymnasium)

    def __init__(
        self, plans: list[Plan], config: EnvironmentConfig | None = None
    ) -> None:
        self.config = config or EnvironmentConfig()
        self.plans = plans
        self._robot = get_robot(self.config.robot)
        plant = self.config.plant
        self._diagram = _diagram(
            self.config.robot, plant.contact, plant.time_step, plant.friction
        )
        self._simulator = Simulator(self._diagram, self._diagram.CreateDefaultContext())
        ConfigureSimulator(self._simulator, plant)
        self._context = self._simulator.get_mutable_context()
        self._plant = self._diagram.GetSubsystemByName("plant")
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        self._player = self._diagram.GetSubsystemByName("reference")
        self._player_context = self._player.GetMyMutableContextFromRoot(self._context)
        self._action = self._diagram.GetInputPort("action").FixValue(
            self._context, np.zeros(12)
        )
        self._ports = {
            name: self._diagram.GetOutputPort(name)
            for name in ("observation", "reward_terms", "state", "plan_state")
        }
        self.observation_space = gymnasium.spaces.Box(
            -np.inf, np.inf, (OBSERVATION_SIZE,), np.float32
        )
        self.action_space = gymnasium.spaces.Box(-10.0, 10.0, (12,), np.float32)
        self._step = 0
        self._last_step = 0
        self._start: dict[str, int] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; see the class for ``options``."""
        super().reset(seed=seed)
        options = options or {}
        i = options.get("plan")
        if i is None:
            i = int(self.np_random.integers(len(self.plans)))
        plan = self.plans[i]
        sample = options.get("sample")
        if sample is None:
            # Leaves time for half an episode where the plan is that long.
            room = max(1, len(plan) - self.config.episode_steps // 2)
            sample = int(self.np_random.integers(room))
        self._start = {"plan": i, "sample": sample}
        self._step = sample
        self._last_step = min(sample + self.config.episode_steps, len(plan) - 1)

        self._diagram.SetDefaultContext(self._context)
        self._context.SetTime(sample * PLAN_DT)
        self._player.SetPlan(self._player_context, plan)
        self._action.GetMutableData().get_mutable_value().set_value(np.zeros(12))
        state = self.config.reset_noise.draw(plan.state[sample], self.np_random)
        self._plant.SetPositionsAndVelocities(self._plant_context, state)
        self._simulator.Initialize()
        return self._observe(), dict(self._start)

    def step(
        self, action: Observation
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advances by one control period."""
        self._action.GetMutableData().get_mutable_value().set_value(action)
        self._step += 1
        self._simulator.AdvanceTo(self._step * PLAN_DT, interruptible=False)
        terms = self._ports["reward_terms"].Eval(self._context)
        terminated = is_lost(
            self._robot,
            self.config.termination,
            self._ports["state"].Eval(self._context),
            self._ports["plan_state"].Eval(self._context),
        )
        truncated = not terminated and self._step >= self._last_step
        info = {**self._start, **dict(zip(REWARD_TERMS, terms.tolist(), strict=True))}
        return self._observe(), float(terms.sum()), terminated, truncated, info

    def _observe(self) -> Observation:
        observation = self._ports["observation"].Eval(self._context)
        return observation.astype(np.float32)
