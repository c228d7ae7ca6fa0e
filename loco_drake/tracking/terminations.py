"""When a training episode ends early."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loco_drake.models.robots import Robot
from loco_drake.rotations import quat_error
from loco_drake.systems.fall import has_fallen


@dataclass(kw_only=True)
class TerminationConfig:
    """How far the robot may be from its plan before an episode ends.

    Joint errors cannot see a robot that stands still while its plan walks off, so the
    base's lag ends episodes too (Bogdanovic et al. 2022 and others).

    Attributes:
        position: distance of the base from the plan's, m.
        rotation: angle of the base from the plan's, rad.
    """

    position: float = 0.35
    rotation: float = 0.8


def is_lost(
    robot: Robot,
    config: TerminationConfig,
    state: NDArray[np.float64],
    plan_state: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Returns whether each robot fell or is too far from its plan to come back, (...).

    Args:
        robot: the robot.
        config: how far is too far.
        state: the plant's [q, v], shape (..., 37).
        plan_state: the same of the plan.
    """
    gap = np.linalg.norm(state[..., 4:7] - plan_state[..., 4:7], axis=-1)
    turn = np.linalg.norm(quat_error(state[..., :4], plan_state[..., :4]), axis=-1)
    strayed = (gap > config.position) | (turn > config.rotation)
    return has_fallen(robot, state[..., :19]) | strayed
