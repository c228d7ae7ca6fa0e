"""Which plan the next episode follows: more of the gaits that are still done badly."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.control.plan import Plan
from loco_drake.motion.gaits import ROW_LABELS

_MEMORY = 0.98  # weight of the past in a label's score, per episode
_PLAN_MEMORY = 0.6  # the same of a plan's score: it is drawn seldom
# Even a perfect gait is drawn now and then, so that it is not forgotten; and those that
# hardly begin to work must not take the time of those that are being learned.
_LEAST, _MOST = 0.1, 0.8
_MOST_OF_PLAN = 0.5  # within a label; a plan that nobody could follow is to be no sink
_SHORTEST = 0.05  # share of an episode that the shortest are taken to last


class PlanSampler:
    """Draws labels so that they get steps for what they lack, and so a label's plans.

    A gait's share of the *steps*, not of the episodes, is proportional to a power of
    the return that it lacks, within bounds: episodes that end in an early fall are
    short, and what falls would hardly be practised otherwise. The power is the square,
    since most of what a gait lacks in training, some ten of a hundred, is the noise of
    the actions. The plans of a label share its steps by the same rule: a bound on the
    spot and one at a metre a second have the same label. What has not been drawn yet
    counts as its label does.

    Args:
        plans: what to draw from; the label of a plan is that of its first sample.
        seed: of the draws.
    """

    def __init__(self, plans: list[Plan], seed: int) -> None:
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
        scores = _filled(self.plan_scores[plans], self.scores[label])
        shares = _filled(self.plan_shares[plans], self.shares[label])
        return self._choose(plans, scores, shares, _MOST_OF_PLAN)

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
        """Takes note of an episode on ``plan``.

        Args:
            plan: index of the plan.
            score: normalized return, 0 to 1.
            share: steps that it made over those of an episode, 0 to 1.
        """
        label = self._labels[plan]
        for mean, value in ((self.scores, score), (self.shares, share)):
            mean[label] = _MEMORY * mean[label] + (1 - _MEMORY) * value
        for mean, value in ((self.plan_scores, score), (self.plan_shares, share)):
            past = value if np.isnan(mean[plan]) else mean[plan]
            mean[plan] = _PLAN_MEMORY * past + (1 - _PLAN_MEMORY) * value

    def score_by_label(self) -> dict[str, float]:
        """Returns the mean over its plans of recent normalized returns, 0 to 100."""
        drawn = ~np.isnan(self.plan_scores)
        scores = {
            i: self.plan_scores[drawn & (self._labels == i)] for i in self.present
        }
        return {
            str(ROW_LABELS[i]): 100 * float(own.mean()) if len(own) else 0.0
            for i, own in scores.items()
        }


def _filled(values: NDArray[np.float64], value: float) -> NDArray[np.float64]:
    return np.where(np.isnan(values), value, values)
