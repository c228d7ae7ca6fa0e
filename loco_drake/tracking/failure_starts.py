"""Sampling of the samples of a plan to start at, which favours those of failures."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.control.plan import Plan

Array = NDArray[np.float64]

BIN = 50  # samples of a plan, 1 s
_MEMORY = 0.8  # weight of the past in a bin's failure rate, per visit
# What a failure counts for starts in its own bin, and in the ones before it, so that
# episodes also practise what leads to it.
_LEAD = (1.0, 0.5, 0.25)


class FailureStarts:
    """Draws where episodes on a plan start, in part in proportion to failure rates.

    Plans are divided into bins of 1 s (as by BeyondMimic, Liao et al. 2025). A bin's
    failure rate f is an exponential mean over the episodes that were in it: 1 if one
    failed there, 0 if it left it or was truncated. Of the B bins that a plan can be
    started in, bin b is drawn with the probability

        (1 - weight) / B + weight * g_b / sum(g),  g_b = f_b + f_{b+1} / 2 + f_{b+2} / 4

    and a sample within it uniformly. The first term is the floor, which keeps every bin
    in practice. Without failures all bins are equally likely.
    """

    def __init__(self, plans: list[Plan], weight: float) -> None:
        self._weight = weight
        self._bins = np.array([-(-len(plan) // BIN) for plan in plans])
        # By plan and bin; bins that a plan does not have stay 0.
        self.rates: Array = np.zeros((len(plans), int(self._bins.max())))

    def probabilities(self, plan: int, count: int) -> Array:
        """Returns the probabilities of the first ``count`` bins of a plan."""
        rates = np.pad(self.rates[plan], (0, len(_LEAD)))
        g = sum(share * rates[k : k + count] for k, share in enumerate(_LEAD))
        uniform = np.full(count, 1 / count)
        if not np.any(g):
            return uniform
        return (1 - self._weight) * uniform + self._weight * g / np.sum(g)

    def draw(self, plan: int, last: int, random: np.random.Generator) -> int:
        """Returns a sample of a plan to start at, from 0 to ``last``."""
        count = last // BIN + 1
        chosen = int(random.choice(count, p=self.probabilities(plan, count)))
        return int(random.integers(chosen * BIN, min((chosen + 1) * BIN, last + 1)))

    def record(self, plan: int, start: int, end: int, failed: bool) -> None:
        """Records an episode from one sample of a plan to another."""
        first, last = start // BIN, end // BIN
        outcome = np.zeros(last - first + 1)
        outcome[-1] = failed
        own = self.rates[plan, first : last + 1]
        own[:] = _MEMORY * own + (1 - _MEMORY) * outcome
