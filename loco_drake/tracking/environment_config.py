"""What a tracking environment is, but for its plans."""

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
from loco_drake.tracking.terminations import TerminationConfig

Array = NDArray[np.float64]


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
