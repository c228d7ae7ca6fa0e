"""Which gait to walk at a command: the one that is cheapest and steadiest there.

``evaluate steering`` measures each gait at the points of a grid of commands. The score
of a gait at a point is

    cost of transport / (return / 100 * (1 - fall rate))^2

and the lowest one is the best. The cost of transport is that of the point, and so is
the return, the share of the tracking reward that the robot earned; the fall rate is the
gait's share of random drives that ended in a fall. Numerator and denominator are ratios
without a unit, so gaits compare at any speed: a gait that is tracked twice as well may
cost four times as much. The square makes a return of 90 instead of 95 weigh as much as
11 % of cost, since what tracks badly at a steady command is what fails at a change.

Between the points the logarithm of the score is interpolated. Along each axis of the
command it is piecewise linear through the middle of the grid, and the three axes add
up. What the corners have beyond that is spread trilinearly, in proportion to the second
largest of the three distances from the middle, as shares of half the range: it vanishes
on the axes, so the interpolation meets every measured point. Left and right are
averaged, since the robot is symmetric and what differs is chance.

Candidates are the gaits whose range holds the command, or else the ones that come
nearest. Hysteresis keeps a command that hovers from changing the gait to and fro; see
:func:`next_choice`.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.command import CommandRange

# Another gait must be better than the present one by this share of its score.
MARGIN = 0.15
# A gait is kept until this much is cut off its command, m/s and rad/s. The goals of
# steering allow a bit more.
LEEWAY = 0.1
# s for which a gait is kept that can follow its command: until it is reached.
PAUSE = 2.5

_LEAST_STEADINESS = 0.01
_MIRROR = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Choice:
    """The gait that is walked."""

    label: int  # index into gaits.LABELS
    since: float = -np.inf  # Context time of the change to it, s


class MeasuredGait:
    """The range of a gait, and its score at each command within.

    Args:
        within: the range of its commands.
        commands: of the measured points, shape (N, 3): the middle of the range, others
            along its axes, and its corners.
        scores: of the points, shape (N,).
    """

    def __init__(self, within: CommandRange, commands: Array, scores: Array) -> None:
        self.range = within
        half = np.array(within.high) - within.middle
        # An axis on which nothing was measured off the middle tells nothing.
        wide = np.ptp(commands, axis=0) > 1e-9
        self._scale = np.divide(1.0, half, out=np.zeros(3), where=wide)
        places = self._place(commands)
        logs = np.log(scores)
        off = np.abs(places) > 1e-6
        self._middle = logs[~off.any(axis=1)][0]
        self._axes = []
        for axis in range(3):
            own = ~np.delete(off, axis, axis=1).any(axis=1)
            knots, first = np.unique(np.round(places[own, axis], 6), return_index=True)
            self._axes.append((knots, logs[own][first] - self._middle))
        ends = itertools.product(*((-1.0, 1.0) if s else (0.0,) for s in self._scale))
        self._corners = [
            (np.array(end), logs[at][0] - self._along(np.array(end)))
            for end in ends
            if (at := (np.abs(places - end) < 1e-6).all(axis=1)).any()
        ]

    @classmethod
    def of_figures(cls, figures: Mapping[str, Any]) -> Self:
        """Returns the gait of one label's figures in the results of steering."""
        points = figures["points"]
        steadiness = np.array([point["normalized_return"] for point in points]) / 100
        steadiness *= 1 - figures["fall_rate"]
        return cls(
            CommandRange.of_figures(figures["range"]),
            np.array([point["command"] for point in points]),
            np.array([point["cost_of_transport"] for point in points])
            / np.maximum(steadiness, _LEAST_STEADINESS) ** 2,
        )

    def excess(self, command: Array) -> float:
        """Returns what is cut off a command (3,), the larger of m/s and rad/s."""
        rest = command - self.range.clip(command)
        return max(float(np.hypot(*rest[:2])), abs(float(rest[2])))

    def score(self, command: Array) -> float:
        """Returns the score at the command of the range that is nearest to one (3,)."""
        both = [self._log(self.range.clip(c)) for c in (command, _MIRROR * command)]
        return float(np.exp(np.mean(both)))

    def _place(self, commands: Array) -> Array:
        """Returns where commands (..., 3) are, from -1 to 1 on each axis of width."""
        place: Array = (commands - self.range.middle) * self._scale
        return place

    def _along(self, place: Array) -> float:
        """Returns the logarithm of the score as far as the axes tell it."""
        return self._middle + sum(
            float(np.interp(value, *axis))
            for value, axis in zip(place, self._axes, strict=True)
        )

    def _log(self, command: Array) -> float:
        place = self._place(command)
        far = np.sort(np.abs(place))[1]
        rest = sum(
            beyond * np.prod((1 + end * place)[end != 0] / 2)
            for end, beyond in self._corners
        )
        return self._along(place) + float(far * rest)


def best_gait(
    gaits: Mapping[int, MeasuredGait], command: Array, present: int | None = None
) -> int:
    """Returns the gait to walk at a command, an index into gaits.LABELS.

    The present one has the advantages of LEEWAY and MARGIN.

    Args:
        gaits: the measured gaits by index, at least one.
        command: forward and sideways velocity in m/s and yaw rate in rad/s, shape (3,).
        present: the gait that is walked, if any.
    """
    excess = {label: gait.excess(command) for label, gait in gaits.items()}
    if present in excess:
        excess[present] = max(excess[present] - LEEWAY, 0.0)
    least = min(excess.values())

    def score(label: int) -> float:
        share = 1 - MARGIN if label == present else 1.0
        return share * gaits[label].score(command)

    nearest = [label for label in gaits if excess[label] <= least + 1e-9]
    return min(nearest, key=score)


def next_choice(
    gaits: Mapping[int, MeasuredGait], command: Array, before: Choice, time: float
) -> Choice:
    """Returns the choice at Context time ``time``, s.

    The gait changes to one that follows the command where the present one does not, up
    to LEEWAY, and to one whose score is lower by MARGIN, but for that reason not within
    PAUSE of the last change.
    """
    label = best_gait(gaits, command, before.label)
    if label == before.label:
        return before
    present = gaits.get(before.label)
    follows = present is not None and (
        present.excess(command) - LEEWAY <= gaits[label].excess(command)
    )
    if follows and time - before.since < PAUSE:
        return before
    return Choice(label, time)
