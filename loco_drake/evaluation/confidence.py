"""Confidence intervals of measured figures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from loco_drake.common.arrays import Array

RESAMPLES = 1000
_Z = float(norm.ppf(0.975))


@dataclass(frozen=True)
class Estimate:
    """A mean and its 95 % interval."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3f} [{self.low:.3f}, {self.high:.3f}]"


def wilson(share: float, count: float) -> tuple[float, float]:
    """Returns Wilson's 95 % interval of a share observed in ``count`` trials.

    Wilson 1927. Unlike a bootstrap it does not collapse to a point if all trials
    succeed.
    """
    z2 = _Z**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    spread = share * (1 - share) / count + z2 / (4 * count**2)
    half = _Z * spread**0.5 / (1 + z2 / count)
    return max(0.0, middle - half), min(1.0, middle + half)


def accuracy(
    correct: Array, weights: Array, groups: NDArray[np.str_], seed: int = 0
) -> Estimate:
    """Returns a weighted accuracy and its 95 % interval.

    The interval covers both what it depends on: the run (seed of a classifier) and the
    trajectories. It is the union of a bootstrap, which draws runs and whole groups
    anew (1000 times, percentiles 2.5 and 97.5), and of Wilson's for as many trials as
    the weighted trajectories are worth, ``sum(w)^2 / sum(w^2)``: runs are no new
    trials.

    Args:
        correct: share of each trajectory classified correctly in each run, in [0, 1],
            shape (runs, N).
        weights: weight of each trajectory, shape (N,).
        groups: group of each trajectory, such as its recording, shape (N,).
        seed: seed of the bootstrap.
    """
    weights = weights / weights.sum()
    mean = float(np.mean(correct @ weights))
    names, place = np.unique(groups, return_inverse=True)
    # (runs, groups): what each group adds to the accuracy, and to the weight.
    member = np.zeros((len(weights), len(names)))
    member[np.arange(len(weights)), place] = weights
    right, weight = correct @ member, member.sum(axis=0)
    random = np.random.default_rng(seed)
    # How often each run and each group is drawn, (RESAMPLES, runs) and (.., groups).
    runs, times = (
        random.multinomial(size, np.full(size, 1 / size), RESAMPLES)
        for size in right.shape
    )
    drawn = (runs @ right * times).sum(axis=1) / (times @ weight) / len(right)
    low, high = np.percentile(drawn, (2.5, 97.5))
    wilson_low, wilson_high = wilson(mean, float(1.0 / (weights**2).sum()))
    return Estimate(mean, min(float(low), wilson_low), max(float(high), wilson_high))
