"""Registration of ``loco_drake/Tracking-v0`` with Gymnasium.

Importing :mod:`loco_drake` registers the environment, since Gymnasium 1 has no entry
points for this. This module imports nothing slow.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import gymnasium

if TYPE_CHECKING:
    from loco_drake.tracking.config import EnvironmentConfig
    from loco_drake.tracking.environment import TrackingEnv


def register() -> None:
    """Registers the environment."""
    gymnasium.register(
        id="loco_drake/Tracking-v0",
        entry_point="loco_drake.tracking.registration:make_tracking",
    )


def make_tracking(
    config: "EnvironmentConfig | None" = None,
    references: Path | None = None,
    labels: Sequence[str] = ("dog-pace", "dog-trot"),
    count: int = 4,
    seconds: float = 6.0,
    seed: int = 0,
) -> "TrackingEnv":
    """Returns a TrackingEnv.

    Args:
        config: configuration of the environment.
        references: folder of Motion files to track. If None, the shipped weights
            generate motion as follows.
        labels: gaits to generate.
        count: motions per gait.
        seconds: length of each motion, s.
        seed: seed of the generated motion.
    """
    from loco_drake.models.robots import get_robot
    from loco_drake.tracking.config import EnvironmentConfig
    from loco_drake.tracking.environment import TrackingEnv
    from loco_drake.tracking.references import generate_references, load_references

    config = config or EnvironmentConfig()
    robot = get_robot(config.robot)
    if references is not None:
        plans = load_references(robot, references)
    else:
        plans = generate_references(
            robot, labels, count=count, seconds=seconds, seed=seed
        )
    return TrackingEnv(plans, config)
