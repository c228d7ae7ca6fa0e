"""The robots that one worker of a training simulates."""

import gc
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from loco_drake.control.plan import Plan
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.sampler import Start

# Share of the terminated episodes that are retried from a number of samples before the
# failure, so that difficult moments are practised most.
_RETRIED = 0.5
_LEAD = (25, 125)  # least and most


class Beginning(NamedTuple):
    """All that an episode depends on, besides its actions."""

    random: Any  # state of the robot's random numbers before it
    plan: int
    sample: int | None


class Past(NamedTuple):
    """An episode so far."""

    beginning: Beginning
    actions: NDArray[np.float32]  # (steps, J)


class Reply(NamedTuple):
    """What became of a worker's robots."""

    observations: NDArray[np.float32]  # (B, size)
    beginnings: dict[int, Beginning]  # of the episodes that began, by robot
    # Of a step, (B,): rewards without penalties, penalties and dones; and the infos.
    returns: NDArray[np.float64] = np.zeros(0)
    penalties: NDArray[np.float64] = np.zeros(0)
    dones: NDArray[np.bool_] = np.zeros(0, dtype=np.bool_)
    infos: tuple[dict[str, Any], ...] = ()


class Reset(NamedTuple):
    """Asks for new episodes of all robots."""

    starts: list[Start]


class Step(NamedTuple):
    """Asks for a control period."""

    actions: NDArray[np.float32]  # (B, J)
    starts: list[Start]  # of the next episodes


class Restore(NamedTuple):
    """Asks for the state that another worker has lost."""

    pasts: list[Past]


class Simulation:
    """Robots in their episodes; does what it is asked to.

    Args:
        plans: what to follow.
        config: of the environment.
        exact: whether observations are followed by those of the true state, without the
            sensors' errors.
        seeds: one for each robot.
    """

    def __init__(
        self,
        plans: list[Plan],
        config: EnvironmentConfig,
        exact: bool,
        seeds: list[int],
    ) -> None:
        self._batch = TrackingBatch(plans, config, len(seeds))
        self._random = [np.random.default_rng(seed) for seed in seeds]
        self._exact = exact
        # Exclude permanent objects from garbage collection.
        gc.freeze()

    def __call__(self, asked: Reset | Step | Restore) -> Reply | None:
        """Returns the robots' observations, and of a step what else there is."""
        if isinstance(asked, Step):
            return self._step(asked)
        if isinstance(asked, Reset):
            starts = enumerate(asked.starts)
            begun = {i: self._begin(i, *start) for i, start in starts}
            return Reply(self._observe(), begun)
        self._restore(asked.pasts)
        return None

    def _step(self, asked: Step) -> Reply:
        """Steps all robots and resets those whose episodes ended, as VecEnv asks."""
        batch = self._batch
        begun: dict[int, Beginning] = {}
        terms, terminated, truncated = batch.step(asked.actions)
        penalties = batch.penalty
        observations = self._observe()
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in asked.starts]
        ended = np.flatnonzero(done)
        for i in map(int, ended):
            random = self._random[i]
            infos[i] = {
                "plan": int(batch.plan[i]),
                "samples": (int(batch.start[i]), int(batch.sample[i])),
                "retried": bool(terminated[i]) and random.random() < _RETRIED,
                "TimeLimit.truncated": bool(truncated[i]),
                "terminal_observation": observations[i].copy(),
            }
            plan, sample = asked.starts[i]
            if infos[i]["retried"]:
                lead = int(random.integers(*_LEAD))
                plan, sample = int(batch.plan[i]), max(0, int(batch.sample[i]) - lead)
            begun[i] = self._begin(i, plan, sample)
        if len(ended):
            observations[ended] = self._observe(ended)
        returns = terms.sum(axis=-1)
        return Reply(observations, begun, returns, penalties, done, tuple(infos))

    def _begin(self, i: int, plan: int, sample: int | None) -> Beginning:
        beginning = Beginning(self._random[i].bit_generator.state, plan, sample)
        self._batch.reset(i, self._random[i], plan, sample)
        return beginning

    def _restore(self, pasts: list[Past]) -> None:
        """Repeats all episodes, which end at the same time."""
        for left in range(max(len(past.actions) for past in pasts), -1, -1):
            joints = pasts[0].actions.shape[-1]
            actions = np.zeros((len(pasts), joints), dtype=np.float32)
            for i, (beginning, own) in enumerate(pasts):
                if len(own) <= left:  # its turn has not come before
                    self._random[i].bit_generator.state = beginning.random
                    self._batch.reset(i, self._random[i], *beginning[1:])
                if 0 < left <= len(own):
                    actions[i] = own[len(own) - left]
            if left:
                self._batch.step(actions)

    def _observe(
        self, robots: NDArray[np.int64] | slice = slice(None)
    ) -> NDArray[np.float32]:
        """Returns observations as measured and, if wanted, behind them exact ones."""
        seen = self._batch.observe(robots)
        if not self._exact:
            return seen
        return np.hstack((seen, self._batch.observe(robots, exact=True)))
