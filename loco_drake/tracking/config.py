"""Configuration of the training of the tracking policy; also the command's options."""

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray

from loco_drake.common.errors import InputError, check_at_least, check_bounds
from loco_drake.common.rotations import quat_multiply, quat_rotate, yaw_quat
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
    TerminationConfig,
    split,
)
from loco_drake.models.plant import PlantConfig, plant_damping
from loco_drake.models.robots import get_simulated
from loco_drake.tracking.randomization import RandomizationConfig

Array = NDArray[np.float64]


@dataclass(kw_only=True)
class ResetNoise:
    """Standard deviations of the initial state about the plan's state.

    Starting beside the plan teaches the policy to return to it. Without this noise a
    policy that is pushed off the plan stays beside it.
    """

    # Joint angles, rad.
    joints: float = 0.02
    # Velocities of joints (rad/s) and base (rad/s and m/s).
    velocities: float = 0.1
    # Position of the base along x and y, m.
    position: float = 0.1
    # Heading of the base, rad; its velocity turns with it.
    heading: float = 0.1

    def draw(self, state: Array, random: np.random.Generator) -> Array:
        """Returns a random state [q, v], as in Plan, near ``state``."""
        state = state.copy()
        q, v = split(state)
        turn = yaw_quat(self.heading * random.standard_normal(1))[0]
        q[ORIENTATION] = quat_multiply(turn, q[ORIENTATION])
        v[ANGULAR_VELOCITY] = quat_rotate(turn, v[ANGULAR_VELOCITY])
        v[VELOCITY] = quat_rotate(turn, v[VELOCITY])
        q[POSITION][:2] += self.position * random.standard_normal(2)
        q[JOINTS] += self.joints * random.standard_normal(q.shape[-1] - 7)
        v += self.velocities * random.standard_normal(v.shape[-1])
        return state


@dataclass(kw_only=True)
class EnvironmentConfig:
    """Configuration of an environment, without its plans."""

    # Robot: go2, a1, or a YAML file, see docs/own_robot.md; or g1, see
    # docs/humanoid.md.
    robot: Annotated[str, tyro.conf.arg(metavar="ROBOT|FILE")] = "go2"
    # Contact solver, time step and friction.
    plant: PlantConfig = field(default_factory=PlantConfig)
    # Distance from the plan at which an episode ends.
    termination: TerminationConfig = field(default_factory=TerminationConfig)
    # Steps after which an episode is truncated.
    episode_steps: int = 200
    # Standard deviations of the initial state about the plan.
    reset_noise: ResetNoise = field(default_factory=ResetNoise)
    # Training penalty per step and per metre of distance from the plan, 1/m. The
    # reward's own term is flat beyond half a metre. Reported returns do not include it.
    position_penalty: float = 0.0
    # Training cost of a fall in perfect steps, beyond the steps that it loses. Reported
    # returns do not include it.
    fall_cost: float = 0.0
    # Training penalty per step on the mean square of the actions. What they need not
    # correct is then left to the feed-forward. Reported returns do not include it.
    action_penalty: float = 0.0
    # Share of the episodes that start where episodes have failed, in proportion to
    # failure rates by the second of a plan; the others start anywhere.
    failure_weight: float = 0.0
    # Domain randomization; a range is two numbers.
    randomization: RandomizationConfig = field(default_factory=RandomizationConfig)

    def check(self) -> None:
        """Raises InputError unless every part is sound."""
        robot = get_simulated(self.robot)
        self.plant.check()
        plant_damping(robot, self.plant)
        self.termination.check()
        check_at_least("episode_steps", self.episode_steps, 1)
        for name, value in vars(self.reset_noise).items():
            check_bounds(f"--reset-noise.{name}", value, 0)
        check_bounds("--position-penalty", self.position_penalty, 0)
        check_bounds("--fall-cost", self.fall_cost, 0)
        check_bounds("--action-penalty", self.action_penalty, 0)
        check_bounds("--failure-weight", self.failure_weight, 0, 1)
        self.randomization.check(robot, self.plant)

    def known_to(self, *, privileged: bool) -> "EnvironmentConfig":
        """Returns the configuration for a policy that may lack privileged observations.

        A policy that does not observe its position inevitably drifts from the plan. Its
        episodes end at a distance of at least 1 m, and start on the plan in x and y.
        """
        if privileged:
            return self
        position = max(self.termination.position, 1.0)
        return replace(
            self,
            termination=replace(self.termination, position=position),
            reset_noise=replace(self.reset_noise, position=0.0),
        )


@dataclass(kw_only=True)
class PpoConfig:
    """Configuration of PPO."""

    # Environment steps between updates. An interruption loses at most one batch.
    batch: int = 4096
    # Samples in a minibatch.
    minibatch: int = 1024
    # Epochs per batch.
    epochs: int = 5
    # Discount factor per step.
    gamma: float = 0.97
    # Lambda of generalized advantage estimation.
    gae_lambda: float = 0.95
    # Clipping range of the probability ratio.
    clip: float = 0.2
    # Initial learning rate of the actor.
    actor_rate: float = 5e-4
    # KL divergence per update that the actor's learning rate is adapted to (Schulman et
    # al. 2017; Rudin et al. 2022).
    target_kl: float = 0.02
    # Learning rate of the critic.
    critic_rate: float = 1e-3
    # Initial log standard deviation of the actions of new networks.
    log_std: float = -0.7
    # That of networks to start from.
    restart_log_std: Annotated[
        float | None, tyro.conf.arg(help_behavior_hint="(default: theirs)")
    ] = None
    # Environment steps at the beginning in which only the critic learns, so that it
    # knows new motion before it judges the actor.
    critic_first: int = 0
    # Whether the standard deviation is learned, rather than held.
    learn_std: bool = True
    # Weight of the entropy of the actions in the loss.
    entropy: float = 0.0
    # Widths of the hidden layers, of actor and critic each.
    hidden: list[int] = field(default_factory=lambda: [256, 128])
    # Whether the policy observes position and velocity of the base, which a real robot
    # does not know well. The critic always does.
    privileged: bool = True

    def check(self, environments: int) -> None:
        """Raises InputError unless it fits so many environments."""
        if self.batch < 2 * environments:
            raise InputError(
                f"--batch must be at least {2 * environments}, two steps of each of "
                f"{environments} environments, not {self.batch}."
            )
        check_at_least("minibatch", self.minibatch, 1)
        check_at_least("epochs", self.epochs, 1)
        if not self.hidden or min(self.hidden) < 1:
            raise InputError(f"--hidden must be widths above 0, not {self.hidden}.")
        for name in ("gamma", "gae_lambda", "clip", "actor_rate", "critic_rate"):
            option = f"--{name.replace('_', '-')}"
            check_bounds(option, getattr(self, name), 0, 1, above=True)
        check_bounds("--target-kl", self.target_kl, 0, above=True)
        check_bounds("--entropy", self.entropy, 0)
        check_at_least("critic_first", self.critic_first, 0)
        for name in ("log_std", "restart_log_std"):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value):
                option = f"--{name.replace('_', '-')}"
                raise InputError(f"{option} must be a number, not {value}.")


@dataclass(kw_only=True)
class TrainingConfig:
    """Configuration of a training."""

    # Number of training steps: those of the environments, of 20 ms, before --resume and
    # after it.
    steps: int = 2_000_000
    # Number of worker processes.
    workers: int = 2
    # Environments in each worker process.
    per_worker: int = 8
    # Seed: of all random numbers.
    seed: int = 0
    # The environment.
    environment: Annotated[EnvironmentConfig, tyro.conf.arg(name="")] = field(
        default_factory=EnvironmentConfig
    )
    # The learner.
    ppo: Annotated[PpoConfig, tyro.conf.arg(name="")] = field(default_factory=PpoConfig)

    def check(self) -> None:
        """Raises InputError unless a training can begin."""
        check_at_least("workers", self.workers, 1)
        check_at_least("per_worker", self.per_worker, 1)
        self.environment.check()
        self.ppo.check(self.workers * self.per_worker)


@dataclass(kw_only=True)
class StudentConfig:
    """Configuration of a student's training."""

    # Number of training steps: those of the environments, of 20 ms, rounded up to whole
    # batches.
    steps: int = 500_000
    # Number of worker processes.
    workers: int = 2
    # Environments in each worker process.
    per_worker: int = 16
    # Seed: of all random numbers.
    seed: int = 0
    # Environment steps between updates. An interruption loses at most one batch.
    batch: int = 4096
    # Samples in a minibatch.
    minibatch: int = 512
    # Number of updates: per batch.
    updates: int = 128
    # Learning rate: the initial one, which decays to 0 as a half cosine.
    learning_rate: float = 1e-3
    # Samples that are kept to learn from.
    capacity: int = 262_144
    # Share of the steps over which the teacher's share of the actions falls from all to
    # none.
    handover: float = 0.05
    # Measurements that the student remembers besides the present one, one each 20 ms.
    history: int = 10
    # The environment.
    environment: Annotated[EnvironmentConfig, tyro.conf.arg(name="")] = field(
        default_factory=EnvironmentConfig
    )

    def check(self) -> None:
        """Raises InputError unless a training can begin."""
        for name in ("workers", "per_worker", "minibatch", "updates", "history"):
            check_at_least(name, getattr(self, name), 1)
        robots = self.workers * self.per_worker
        if self.batch < robots:
            raise InputError(
                f"--batch must be at least {robots}, a step of each environment, not "
                f"{self.batch}."
            )
        check_at_least("capacity", self.capacity, self.batch)
        check_bounds("--learning-rate", self.learning_rate, 0, 1, above=True)
        check_bounds("--handover", self.handover, 0, 1)
        self.environment.check()
