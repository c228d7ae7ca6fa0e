"""Whether a robot survives a disturbance, how much, and how fast it recovers.

*Success.* The robot does not fall, and moves along with its plan in the end: over the
last 2 s of the episode, with the plan aligned at their start, the base's errors are at
most .3 m and .5 rad (:func:`loco_drake.evaluation.tracking.base_errors`). A robot that
stands still before a step, or slides down a slope, is no success.

*Recovery.* The time from the end of a push to the first half second in which the base's
errors, aligned at its start, and that of the joints are within a band. The band is the
95th percentile of the errors of all such half seconds of an episode on the same plan
without a disturbance.

*The level of 80 % success.* The largest level at which the success curve is at least
.8. The curve is the monotone fit of the shares by least squares, weighted by the number
of episodes (isotonic regression), with straight lines between levels. The 95 % interval
is of the fits to shares drawn from their distribution given the successes (beta
distribution, Jeffreys' prior), independent for each level: unlike a bootstrap it does
not collapse where all succeed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import isotonic_regression

from loco_drake.common.arrays import Array
from loco_drake.control.plan import PLAN_DT
from loco_drake.evaluation.confidence import RESAMPLES
from loco_drake.evaluation.tracking import WINDOW, Rollout, base_errors, joint_rmse

MAX_POSITION_ERROR = 0.3  # m
MAX_ORIENTATION_ERROR = 0.5  # rad
SHARE = 0.8  # of success, for which a level is asked
_PERCENTILE = 95.0
_WINDOW = round(0.5 / PLAN_DT)  # samples in which a robot must have recovered


@dataclass(frozen=True)
class Threshold:
    """The level of 80 % success and its 95 % interval."""

    level: float
    low: float
    high: float
    beyond: bool  # whether it may be more: the most severe level is survived as often


def succeeded(rollout: Rollout) -> bool:
    """Returns whether an episode is a success, as defined above."""
    if rollout.fell:
        return False
    last = _cut(rollout, len(rollout.state) - 1 - round(WINDOW / PLAN_DT))
    position, orientation = base_errors(last)
    return position <= MAX_POSITION_ERROR and orientation <= MAX_ORIENTATION_ERROR


def recovery_band(undisturbed: Rollout) -> Array | None:
    """Returns the band of position, orientation and joints, m, rad, rad, (3,).

    None if the episode is shorter than a window.
    """
    starts = range(len(undisturbed.state) - _WINDOW)
    errors = [_errors(undisturbed, start) for start in starts]
    return np.percentile(errors, _PERCENTILE, axis=0) if errors else None


def recovery_time(rollout: Rollout, end: int, band: Array) -> float | None:
    """Returns the time to recover from a push, s; None if the robot never does.

    Args:
        rollout: the episode.
        end: sample at which the push ends.
        band: from :func:`recovery_band`.
    """
    for start in range(end, len(rollout.state) - _WINDOW):
        if (_errors(rollout, start) <= band).all():
            return (start - end) * PLAN_DT
    return None


def success_threshold(
    levels: Sequence[float], successes: Sequence[int], episodes: Sequence[int]
) -> Threshold:
    """Returns the level of 80 % success, as defined above.

    Args:
        levels: from mild to severe, the undisturbed one first.
        successes: number of them at each level.
        episodes: number at each level, at least 1.
    """
    won, of = np.array(successes, float), np.array(episodes, float)
    level, beyond = _crossing(levels, won / of, of)
    random = np.random.default_rng(0)
    shares = random.beta(won + 0.5, of - won + 0.5, (RESAMPLES, len(of)))
    drawn = np.array([_crossing(levels, share, of)[0] for share in shares])
    # Severe levels may be the smaller ones, as of friction.
    places = np.interp(drawn, *_ascending(levels))
    low, high = np.interp(
        np.percentile(places, (2.5, 97.5)), np.arange(len(levels)), levels
    ).tolist()
    return Threshold(level, low, high, beyond)


def _ascending(levels: Sequence[float]) -> tuple[Array, Array]:
    """Returns levels in ascending order, and their places from mild to severe."""
    order = np.argsort(levels)
    return np.array(levels, float)[order], order.astype(float)


def _crossing(
    levels: Sequence[float], shares: Array, weights: Array
) -> tuple[float, bool]:
    fit = isotonic_regression(shares, weights=weights, increasing=False).x
    enough = np.flatnonzero(fit >= SHARE - 1e-12)
    if len(enough) == 0:
        return float(levels[0]), False
    last = int(enough[-1])
    if last == len(levels) - 1:
        return float(levels[last]), True
    part = (fit[last] - SHARE) / (fit[last] - fit[last + 1])
    return float(levels[last] + part * (levels[last + 1] - levels[last])), False


def _errors(rollout: Rollout, start: int) -> Array:
    """Returns errors of position, orientation and joints in one window, (3,)."""
    window = _cut(rollout, start, start + _WINDOW)
    return np.array([*base_errors(window), joint_rmse(window)])


def _cut(rollout: Rollout, first: int, last: int | None = None) -> Rollout:
    """Returns the samples from ``first`` to ``last``, both inclusive."""
    part = slice(max(first, 0), None if last is None else last + 1)
    return replace(
        rollout, state=rollout.state[part], plan_state=rollout.plan_state[part]
    )
