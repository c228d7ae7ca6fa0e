"""A number to reach, and whether it is reached."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from loco_drake.evaluation.report.results import Results

MET, BEST, MISSED, UNKNOWN = "met", "dream met", "missed", "not measured"
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Measured:
    """A measured figure, in the unit of its goal.

    Attributes:
        value: the figure.
        low: of its 95 % interval, if there is one.
        high: of the same.
        price: what it was bought with, or where it was found, in words.
        paid: False if the price is above what the goal allows.
    """

    value: float
    low: float | None = None
    high: float | None = None
    price: str = ""
    paid: bool = True


@dataclass(frozen=True)
class Goal:
    """A number to reach.

    Attributes:
        part: of the pipeline.
        title: what is measured.
        unit: of the figures, for people.
        known: the paper's figure or the best known, for people.
        aim: what to reach, for people.
        measure: returns the figure of a robot, None where it was not measured.
        low: the least that reaches the aim.
        high: the most that reaches it.
        dream: beyond the aim: (for people, least, most).
        digits: of figures, after the point.
    """

    part: str
    title: str
    unit: str
    known: str
    aim: str
    measure: Callable[[Results, str], Measured | None]
    low: float = -inf
    high: float = inf
    dream: tuple[str, float, float] | None = None
    digits: int = 3

    def verdict(self, measured: Measured | None) -> str:
        """Returns MET, BEST (the dream too), MISSED or UNKNOWN.

        The mean decides, not its interval; a figure whose price is too high misses.
        """
        if measured is None:
            return UNKNOWN
        if not (measured.paid and _within(measured.value, self.low, self.high)):
            return MISSED
        if self.dream is not None and _within(measured.value, *self.dream[1:]):
            return BEST
        return MET


def _within(value: float, low: float, high: float) -> bool:
    return low - _ROUNDING <= value <= high + _ROUNDING
