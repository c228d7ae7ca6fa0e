"""All that a training of the tracker can be told; the command line takes the same."""

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray

from loco_drake.common.errors import InputError, check_at_least
from loco_drake.common.rotations import quat_multiply, quat_rotate, yaw_quat
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.tracking.randomization import RandomizationConfig

Array = NDArray[np.float64]


@dataclass(kw_only=True)
class TerminationConfig:
    """How far the robot may be from its plan before an episode ends.

    Joint errors cannot see a robot that stands still while its plan walks off, so the
    base's lag ends episodes too (Bogdanovic et al. 2022 and others).
    """

    position: float = 0.35
    """Distance of the base from the plan's, m."""
    rotation: float = 0.8
    """Angle of the base from the plan's, rad."""

    def check(self) -> None:
        """Raises InputError unless both are above 0."""
        for name, value in vars(self).items():
            if not value > 0:
                raise InputError(
                    f"The termination's {name} must be above 0, not {value}."
                )

    def exceeded(self, state: Array, plan_state: Array) -> NDArray[np.bool_]:
        """Returns whether each robot is too far from its plan to come back, (...).

        Args:
            state: the plant's [q, v], shape (..., 37).
            plan_state: the same of the plan.
        """
        gap = np.linalg.norm(state[..., 4:7] - plan_state[..., 4:7], axis=-1)
        # A turn by an angle a takes a unit quaternion to one whose product with it is
        # cos(a / 2), up to its sign.
        product = np.einsum("...i,...i->...", state[..., :4], plan_state[..., :4])
        turn = 2 * np.arccos(np.minimum(np.abs(product), 1.0))
        return (gap > self.position) | (turn > self.rotation)


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
        state[19:25] = quat_rotate(turn, state[19:25].reshape(2, 3)).ravel()
        state[4:6] += self.position * random.standard_normal(2)
        state[7:19] += self.joints * random.standard_normal(12)
        state[19:] += self.velocities * random.standard_normal(18)
        return state


@dataclass(kw_only=True)
class EnvironmentConfig:
    """An environment, but for its plans."""

    robot: str = "go2"
    """Robot: go2 or a1."""
    plant: PlantConfig = field(default_factory=PlantConfig)
    """Contact solver, time step and friction."""
    termination: TerminationConfig = field(default_factory=TerminationConfig)
    """How far from its plan a robot may be before its episode ends."""
    episode_steps: int = 200
    """Steps after which an episode is truncated."""
    reset_noise: ResetNoise = field(default_factory=ResetNoise)
    """How far from the plan's state episodes start, as standard deviations."""
    position_penalty: Annotated[float, tyro.conf.arg(aliases=("--homing",))] = 0.0
    """What a step loses in training for each metre that the base is beside its plan,
    1/m: the reward's own term for it is flat beyond half a metre. It is no part of the
    returns that are reported."""
    fall_cost: float = 0.0
    """What a fall costs in training beyond the steps that it loses, in steps done
    perfectly: discounting sees some thirty, a judged episode can lose 500. It is no
    part of the returns either."""
    randomization: RandomizationConfig = field(default_factory=RandomizationConfig)
    """In what each episode's world differs from the model; a range is two numbers."""

    def check(self) -> None:
        """Raises InputError unless every part is sound."""
        robot = get_robot(self.robot)
        self.plant.check()
        self.termination.check()
        check_at_least("episode_steps", self.episode_steps, 1)
        noise = {f"reset_noise.{k}": v for k, v in vars(self.reset_noise).items()}
        for name in ("position_penalty", "fall_cost"):
            noise[name] = getattr(self, name)
        for name, value in noise.items():
            if not 0 <= value < np.inf:
                option = "--" + name.replace("_", "-")
                raise InputError(f"{option} must be 0 or more, not {value}.")
        self.randomization.check(robot, self.plant)

    def known_to(self, *, privileged: bool) -> "EnvironmentConfig":
        """Returns what to train a policy in that may not know where in the world it is.

        Such a policy cannot help drifting from the plan, so that episodes do not end
        before 1 m of it, which a robot that stands still reaches all the same; and it
        need not learn to come back from beside it.
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
    """How to learn."""

    batch: int = 4096
    """Environment steps between updates; what is saved lags no more behind."""
    minibatch: int = 1024
    """Environment steps in a gradient step, of those of a batch."""
    epochs: int = 5
    """Passes over a batch."""
    gamma: float = 0.97
    """Discount a step."""
    gae_lambda: float = 0.95
    """Of generalized advantage estimation."""
    clip: float = 0.2
    """Range of the probability ratio."""
    actor_rate: float = 5e-4
    """Learning rate of the actor to start with."""
    target_kl: float = 0.02
    """Divergence that an update should have; the actor's learning rate follows it
    (Schulman et al. 2017; Rudin et al. 2022)."""
    critic_rate: float = 1e-3
    """Learning rate of the critic, which has nothing to diverge from."""
    log_std: float = -0.7
    """Initial log standard deviation of the actions."""
    hidden: list[int] = field(default_factory=lambda: [256, 128])
    """Widths of the hidden layers of actor and critic each."""
    privileged: bool = True
    """Whether the policy sees where in the world the base is and how fast it moves,
    which a robot outside simulation does not know well; the critic always does."""

    def check(self, environments: int) -> None:
        """Raises InputError unless it fits so many environments."""
        if self.batch < 2 * environments:
            raise InputError(
                f"--batch must be at least {2 * environments}, two steps of each of "
                f"{environments} environments, not {self.batch}."
            )
        for name in ("minibatch", "epochs"):
            check_at_least(name, getattr(self, name), 1)
        if not self.hidden or min(self.hidden) < 1:
            raise InputError(f"--hidden must be widths above 0, not {self.hidden}.")
        for name, most in (
            ("gamma", 1.0),
            ("gae_lambda", 1.0),
            ("clip", 1.0),
            ("actor_rate", 1.0),
            ("target_kl", np.inf),
            ("critic_rate", 1.0),
        ):
            value = getattr(self, name)
            if not 0 < value <= most or np.isinf(value):
                limit = f" and at most {most:g}" if np.isfinite(most) else ""
                option = "--" + name.replace("_", "-")
                raise InputError(f"{option} must be above 0{limit}, not {value}.")
        if not np.isfinite(self.log_std):
            raise InputError(f"--log-std must be a number, not {self.log_std}.")


@dataclass(kw_only=True)
class TrainingConfig:
    """How to train a tracker."""

    steps: int = 2_000_000
    """Environment steps in all, of 20 ms each, those before a resume included."""
    workers: int = 2
    """Processes that simulate."""
    per_worker: int = 8
    """Environments in each process."""
    seed: int = 0
    """Of everything random."""
    environment: Annotated[EnvironmentConfig, tyro.conf.arg(name="")] = field(
        default_factory=EnvironmentConfig
    )
    """What is simulated."""
    ppo: Annotated[PpoConfig, tyro.conf.arg(name="")] = field(default_factory=PpoConfig)
    """How is learned."""

    def check(self) -> None:
        """Raises InputError unless a training can begin."""
        for name in ("workers", "per_worker"):
            check_at_least(name, getattr(self, name), 1)
        self.environment.check()
        self.ppo.check(self.workers * self.per_worker)
