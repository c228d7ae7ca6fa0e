"""Sampling of plans for episodes, which favours gaits with low returns."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from loco_drake.common.run_folder import Checkpoint
from loco_drake.control.plan import Plan
from loco_drake.motion.gaits import ROW_LABELS
from loco_drake.tracking.failure_starts import FailureStarts

_MEMORY = 0.98  # weight of the past in a label's score, per episode
_PLAN_MEMORY = 0.6  # the same of a plan's score: it is drawn seldom
# Bounds on the missing return: perfect gaits are still drawn, so that they are not
# forgotten, and gaits without success do not take all the time.
_LEAST, _MOST = 0.1, 0.8
_MOST_OF_PLAN = 0.5  # within a label; a plan that nobody could follow is to be no sink
_SHORTEST = 0.05  # share of an episode that the shortest are taken to last
_SCORES = ("scores", "shares", "plan_scores", "plan_shares")  # of a checkpoint
_FAILURES = "sampler/failure_rates"


# A plan's index, and the sample of it to start at, None where the environment draws it.
Start = tuple[int, int | None]


class PlanSampler:
    """Samples labels, and plans within a label, in proportion to their missing return.

    A gait's share of the *steps*, not of the episodes, is proportional to the square of
    its missing return, within bounds. Episodes that end in an early fall are short, so
    shares of episodes would neglect gaits that fall. The square suppresses the part of
    the missing return that is due to action noise, about ten of a hundred. Plans share
    the steps of their label by the same rule, since a label can contain very different
    motion. Plans not yet drawn have the score of their label. The label of a plan is
    that of its first sample.

    With a ``failure_weight`` above 0 it also draws where episodes start, see
    :class:`.FailureStarts`, such that ``half_episode`` samples of the plan are left.
    """

    def __init__(
        self,
        plans: list[Plan],
        seed: int,
        *,
        failure_weight: float = 0.0,
        half_episode: int = 0,
    ) -> None:
        self.starts = FailureStarts(plans, failure_weight) if failure_weight else None
        self._last_starts = [max(0, len(plan) - 1 - half_episode) for plan in plans]
        self._labels = np.array([int(plan.labels[0]) for plan in plans])
        self.present = np.unique(self._labels)
        # Mean normalized return of recent episodes, 0 to 1, by label.
        self.scores: NDArray[np.float64] = np.zeros(len(ROW_LABELS))
        # Mean share of their steps that recent episodes made, by label.
        self.shares: NDArray[np.float64] = np.ones(len(ROW_LABELS))
        # The same by plan, NaN where it has not been drawn.
        self.plan_scores: NDArray[np.float64] = np.full(len(plans), np.nan)
        self.plan_shares: NDArray[np.float64] = np.full(len(plans), np.nan)
        self.random = np.random.default_rng(seed)

    def draw(self) -> int:
        """Returns the index of a plan."""
        scores, shares = self.scores[self.present], self.shares[self.present]
        label = self._choose(self.present, scores, shares, _MOST)
        plans = np.flatnonzero(self._labels == label)
        undrawn = np.isnan(self.plan_scores[plans])
        scores = np.where(undrawn, self.scores[label], self.plan_scores[plans])
        shares = np.where(undrawn, self.shares[label], self.plan_shares[plans])
        return self._choose(plans, scores, shares, _MOST_OF_PLAN)

    def draw_start(self) -> Start:
        """Returns a plan, and where to start."""
        plan = self.draw()
        if self.starts is None:
            return plan, None
        return plan, self.starts.draw(plan, self._last_starts[plan], self.random)

    def record_end(self, plan: int, start: int, end: int, *, failed: bool) -> None:
        """Records where an episode on a plan started and ended, by its samples."""
        if self.starts is not None:
            self.starts.record(plan, start, end, failed)

    def _choose(
        self,
        among: NDArray[np.int64],
        scores: NDArray[np.float64],
        shares: NDArray[np.float64],
        most: float,
    ) -> int:
        lack = np.clip(1 - scores, _LEAST, most)
        episodes = lack**2 / np.maximum(shares, _SHORTEST)
        return int(self.random.choice(among, p=episodes / episodes.sum()))

    def record(self, plan: int, score: float, share: float) -> None:
        """Records an episode on the plan with that index.

        The score is its normalized return, and the share the steps that it made over
        those of a whole episode; both are from 0 to 1.
        """
        label = self._labels[plan]
        for mean, value in ((self.scores, score), (self.shares, share)):
            mean[label] = _MEMORY * mean[label] + (1 - _MEMORY) * value
        for mean, value in ((self.plan_scores, score), (self.plan_shares, share)):
            past = value if np.isnan(mean[plan]) else mean[plan]
            mean[plan] = _PLAN_MEMORY * past + (1 - _PLAN_MEMORY) * value

    def score_by_label(self) -> dict[str, float]:
        """Returns the mean over its plans of recent normalized returns, 0 to 100."""
        drawn, means = ~np.isnan(self.plan_scores), {}
        for i in self.present:
            own = self.plan_scores[drawn & (self._labels == i)]
            means[str(ROW_LABELS[i])] = 100 * float(own.mean()) if len(own) else 0.0
        return means

    def tensors(self) -> dict[str, Tensor]:
        """Returns the scores for a checkpoint, "sampler/NAME"."""
        scores = {f"sampler/{n}": torch.from_numpy(getattr(self, n)) for n in _SCORES}
        if self.starts is None:
            return scores
        return {**scores, _FAILURES: torch.from_numpy(self.starts.rates)}

    def restore(self, saved: Checkpoint) -> None:
        """Restores what a checkpoint holds: scores, and "sampler_random" as state."""
        for name in _SCORES:
            scores = saved.tensors[f"sampler/{name}"].numpy()
            own = getattr(self, name)
            # Checkpoints of before know fewer labels, and may be of other plans.
            if not name.startswith("plan") or len(own) == len(scores):
                own[: len(scores)] = scores
        if self.starts is not None:
            self.starts.rates[:] = saved.tensors[_FAILURES].numpy()
        self.random.bit_generator.state = saved.state["sampler_random"]
