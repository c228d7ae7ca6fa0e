"""``gymnasium.make("loco_drake/Tracking-v0")``.

Gymnasium knows the environment once :mod:`loco_drake` is imported; since its version 1
there are no entry points for that. This module imports nothing else that takes time.
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
        config: of the environment.
        references: folder of Motion files to follow. Without it motion is generated
            with the shipped weights, as the following say.
        labels: gaits to generate.
        count: motions of each gait.
        seconds: of each motion.
        seed: of what is generated.
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
