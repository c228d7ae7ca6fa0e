"""Goals compared with measured figures."""

from dataclasses import dataclass, replace
from math import inf

from loco_drake.evaluation.report.content import CONTENT, Figure, Goal
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.report.results import Results
from loco_drake.models.robots import ROBOTS
from loco_drake.motion.gaits import LABELS

_LABELS = frozenset(map(str, LABELS))
MET, BEST, MISSED, UNKNOWN = "met", "dream met", "missed", "not measured"


@dataclass(frozen=True)
class Measured:
    """A measured figure, in the unit of its goal."""

    value: float
    low: float | None = None  # of its 95 % interval, if there is one
    high: float | None = None  # of the same
    # What it was bought with, or where it was found, in words.
    notes: tuple[str, ...] = ()
    paid: bool = True  # False if the price is above what the goal allows


@dataclass(frozen=True)
class Line:
    """A goal; what each robot reached, and the verdict, in the order of ROBOTS."""

    goal: Goal
    measured: tuple[Measured | None, ...]

    @property
    def verdicts(self) -> list[str]:
        """MET, BEST (the dream too), MISSED or UNKNOWN for each robot.

        The mean decides, not its interval; a figure whose price is too high misses.
        """
        return [_verdict(self.goal, measured) for measured in self.measured]


def _verdict(goal: Goal, measured: Measured | None) -> str:
    if measured is None:
        return UNKNOWN
    if not measured.paid or measured.value not in goal.aim:
        return MISSED
    return BEST if goal.dream and measured.value in goal.dream else MET


def scoreboard(results: Results) -> dict[str, list[Line]]:
    """Returns all goals by part of the pipeline, with what was measured."""
    return {
        part: [
            Line(goal, tuple(measure(goal, results, r) for r in ROBOTS)) for goal in own
        ]
        for part, own in CONTENT.goals.items()
    }


def counts(parts: dict[str, list[Line]]) -> dict[str, dict[str, int]]:
    """Returns how many goals each robot met, and how many were measured."""
    lines = [line.verdicts for part in parts.values() for line in part]
    return {
        robot: {
            "met": sum(verdict in (MET, BEST) for verdict in verdicts),
            "measured": sum(verdict != UNKNOWN for verdict in verdicts),
            "goals": len(verdicts),
        }
        for robot, verdicts in zip(ROBOTS, zip(*lines, strict=True), strict=True)
    }


def measure(goal: Goal, results: Results, robot: str) -> Measured | None:
    """Returns the figure of a goal, None where it was not measured.

    Raises:
        InputError: if a result is damaged.
    """
    found = _read(goal.figure, results, robot, highest=goal.aim.least == -inf)
    if found is None or goal.price is None:
        return found
    price = goal.price
    figure = Figure(price.file or goal.figure.file, price.path, price.factor)
    paid = _read(figure, results, robot)
    if paid is None:
        note = f"{price.text.partition(' {')[0]} not measured"
        within = (price.least, price.most) == (-inf, inf)
    else:
        note = price.text.format(paid.value)
        within = paid.value in price
    return replace(found, notes=(*found.notes, note), paid=within)


def _read(
    figure: Figure, results: Results, robot: str, *, highest: bool = False
) -> Measured | None:
    """Returns the figure; ``*`` in a key stands for the worst label."""
    found = _found(figure, results, robot)
    if figure.over:
        whole = _found(replace(figure, file=figure.over, factor=1.0), results, robot)
        found = {
            name: Measured(own.value / whole[name].value)
            for name, own in found.items()
            if name in whole and whole[name].value > 0
        }
    ordered = sorted(found, key=lambda name: (found[name].value, name))
    if not ordered:
        return None
    name = ordered[-1 if highest else 0]
    return replace(found[name], notes=(name,)) if name else found[name]


def _found(figure: Figure, results: Results, robot: str) -> dict[str, Measured]:
    """Returns the figures of all labels for ``*`` in the path, else one called ""."""
    within = results.of(figure.file, robot)
    if within is None:
        return {}
    *path, last = figure.path.split(".")
    if "*" in path:
        parts = within.parts(*path[: path.index("*")])
        read = {n: read_measured(part, last, figure.factor) for n, part in parts}
        return {name: own for name, own in read.items() if own is not None}
    for key in path:
        # A gait that was not evaluated is no damage.
        otherwise = None if key in _LABELS else ""
        if within.values.get(key, otherwise) is None:
            return {}
        within = within.part(key)
    own = read_measured(within, last, figure.factor)
    return {} if own is None else {"": own}


def read_measured(figures: Figures, key: str, factor: float) -> Measured | None:
    """Returns a figure, None if it is null; a mean with the ends of its interval."""
    value = figures.entry(key) if key.endswith("]") else figures.required(key)
    low, high = (
        figures.required(end) if key == "mean" else None for end in ("low", "high")
    )
    if value is None:
        return None
    return Measured(factor * value, low and factor * low, high and factor * high)
