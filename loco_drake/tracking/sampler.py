"""Which plan the next episode follows: more of the gaits that are still done badly."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.gaits import LABELS
from loco_drake.systems.plan import Plan

_MEMORY = 0.98  # weight of the past in a label's score, per episode
# Even a perfect gait is drawn now and then, so that it is not forgotten; and those that
# hardly begin to work must not take the time of those that are being learned.
_LEAST, _MOST = 0.1, 0.8
_SHORTEST = 0.05  # share of an episode that the shortest are taken to last


class PlanSampler:
    """Draws labels so that they get steps for what they lack; then one of its plans.

    A gait's share of the *steps*, not of the episodes, is proportional to a power of
    the return that it lacks, within bounds: episodes that end in an early fall are
    short, and what falls would hardly be practised otherwise. The power is the square,
    since most of what a gait lacks in training, some ten of a hundred, is the noise of
    the actions.

    Args:
        plans: what to draw from; the label of a plan is that of its first sample.
        seed: of the draws.
        power: of the lack.
    """

    def __init__(self, plans: list[Plan], seed: int, power: float = 2.0) -> None:
        self._power = power
        self._labels = np.array([int(plan.labels[0]) for plan in plans])
        self.present = np.unique(self._labels)
        # Mean normalized return of recent episodes, 0 to 1, by label.
        self.scores: NDArray[np.float64] = np.zeros(len(LABELS))
        # Mean share of their steps that recent episodes made, by label.
        self.shares: NDArray[np.float64] = np.ones(len(LABELS))
        self.random = np.random.default_rng(seed)

    def draw(self) -> int:
        """Returns the index of a plan."""
        lack = np.clip(1 - self.scores[self.present], _LEAST, _MOST)
        episodes = lack**self._power / np.maximum(self.shares[self.present], _SHORTEST)
        label = self.random.choice(self.present, p=episodes / episodes.sum())
        return int(self.random.choice(np.flatnonzero(self._labels == label)))

    def record(self, plan: int, score: float, share: float) -> None:
        """Takes note of an episode on ``plan``.

        Args:
            plan: index of the plan.
            score: normalized return, 0 to 1.
            share: steps that it made over those of an episode, 0 to 1.
        """
        label = self._labels[plan]
        for mean, value in ((self.scores, score), (self.shares, share)):
            mean[label] = _MEMORY * mean[label] + (1 - _MEMORY) * value

    def score_by_label(self) -> dict[str, float]:
        """Returns the mean normalized return of recent episodes, 0 to 100."""
        return {str(LABELS[i]): 100 * float(self.scores[i]) for i in self.present}
