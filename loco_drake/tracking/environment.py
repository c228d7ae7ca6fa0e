"""The Gymnasium environment of the tracking task."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from loco_drake.control.observation import LAYOUT, Layout, layout_of
from loco_drake.control.plan import Plan
from loco_drake.control.reward import REWARD_TERMS
from loco_drake.models.robots import get_robot, get_simulated
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.references import generate_references, load_references

Observation = NDArray[np.float32]


_Space = gymnasium.spaces.Space[Observation]


def spaces_of(layout: Layout) -> tuple[_Space, _Space]:
    """Returns the spaces of observations and of actions."""
    joints = len(layout.mirror_joints)
    return (
        gymnasium.spaces.Box(-np.inf, np.inf, (layout.size,), np.float32),
        gymnasium.spaces.Box(-10.0, 10.0, (joints,), np.float32),
    )


# Of robots with three joints a leg.
OBSERVATION_SPACE, ACTION_SPACE = spaces_of(LAYOUT)


class TrackingEnv(gymnasium.Env[Observation, Observation]):
    """A robot that tracks a plan, drawn at random for each episode.

    Observations are those of :mod:`loco_drake.control.observation` and actions those of
    :class:`loco_drake.systems.control.JointTargets`. The reward is the sum of
    :func:`loco_drake.control.reward.reward_terms`, at most 1 per step, minus the
    penalties of the configuration, which are 0 by default. An episode starts in a state
    of the plan (reference state initialization, Peng et al. 2018), terminates when the
    robot falls or is too far from its plan, and is truncated at the end of its time or
    plan.

    ``info`` contains the reward terms by name, and the plan and sample at which the
    episode started. ``reset(options={"plan": i, "sample": k})`` selects them.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (as in Gymnasium)

    def __init__(
        self, plans: list[Plan], config: EnvironmentConfig | None = None
    ) -> None:
        self.config = config or EnvironmentConfig()
        self.plans = plans
        layout = layout_of(get_simulated(self.config.robot))
        self.observation_space, self.action_space = spaces_of(layout)
        self._batch = TrackingBatch(plans, self.config, 1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; see the class for ``options``."""
        super().reset(seed=seed)
        self._batch.reset(0, self.np_random, **(options or {}))
        return self._batch.observe()[0], self._start()

    def step(
        self, action: Observation
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advances by one control period."""
        terms, terminated, truncated = self._batch.step(action[None])
        named = dict(zip(REWARD_TERMS, terms[0].tolist(), strict=True))
        return (
            self._batch.observe()[0],
            float(terms.sum() - self._batch.penalty[0]),
            bool(terminated[0]),
            bool(truncated[0]),
            {**self._start(), **named},
        )

    def _start(self) -> dict[str, int]:
        return {"plan": int(self._batch.plan[0]), "sample": int(self._batch.start[0])}


def make_tracking(
    config: EnvironmentConfig | None = None,
    references: Path | None = None,
    labels: Sequence[str] = ("dog-pace", "dog-trot"),
    count: int = 4,
    seconds: float = 6.0,
    seed: int = 0,
) -> TrackingEnv:
    """Returns the environment of ``gymnasium.make("loco_drake/Tracking-v0")``.

    Args:
        config: configuration of the environment.
        references: folder of Motion files to track. If None, the shipped weights
            generate motion as follows.
        labels: gaits to generate.
        count: motions per gait.
        seconds: length of each motion, s.
        seed: seed of the generated motion.
    """
    config = config or EnvironmentConfig()
    if references is not None:
        plans = load_references(get_simulated(config.robot), references)
    else:
        plans = generate_references(
            get_robot(config.robot), labels, count=count, seconds=seconds, seed=seed
        )
    return TrackingEnv(plans, config)
