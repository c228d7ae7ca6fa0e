"""What a tracking environment is, but for its plans."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_multiply, quat_rotate, yaw_quat
from loco_drake.models.plant import PlantConfig
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
    """An environment, but for its plans.

    Attributes:
        robot: name of the robot.
        plant: contact, step and friction.
        termination: when an episode ends early.
        episode_steps: an episode is truncated after this many steps.
        reset_noise: how far from the plan's state episodes start.
        homing: what a step loses in training for each metre that the base is beside
            the plan's, 1/m. The reward's own term for it is flat beyond half a metre,
            so that nothing calls a robot back that strayed further. It is no part of
            returns, and neither is what a fall costs.
        fall_cost: what a fall costs in training beyond the steps that it loses, of
            which discounting sees some thirty; a judged episode can lose 500.
        randomization: in what each episode's world differs from the model.
    """

    robot: str = "go2"
    plant: PlantConfig = field(default_factory=PlantConfig)
    termination: TerminationConfig = field(default_factory=TerminationConfig)
    episode_steps: int = 200
    reset_noise: ResetNoise = field(default_factory=ResetNoise)
    homing: float = 0.0
    fall_cost: float = 0.0
    randomization: RandomizationConfig = field(default_factory=RandomizationConfig)

    def without_position(self) -> "EnvironmentConfig":
        """Returns a copy for policies that do not know where in the world they are.

        They cannot help drifting from the plan, so that episodes do not end before
        1 m of it, which a robot that stands still reaches all the same; and they need
        not learn to come back from beside it.
        """
        return replace(
            self,
            termination=replace(
                self.termination, position=max(self.termination.position, 1.0)
            ),
            reset_noise=replace(self.reset_noise, position=0.0),
        )
