"""The goals beside what was measured, for the top of the page."""

from dataclasses import dataclass

from loco_drake.evaluation.report.goal import BEST, MET, UNKNOWN, Goal, Measured
from loco_drake.evaluation.report.goals import GOALS
from loco_drake.evaluation.report.results import Results
from loco_drake.evaluation.report.tables import NOTHING, Cell, number
from loco_drake.models.robots import ROBOTS


@dataclass(frozen=True)
class Score:
    """What a robot reached of a goal.

    Attributes:
        cell: the figure, with its interval and its price.
        verdict: of :meth:`Goal.verdict`.
    """

    cell: Cell
    verdict: str


@dataclass(frozen=True)
class Line:
    """A goal, and what each robot reached of it, in the order of ROBOTS."""

    goal: Goal
    scores: tuple[Score, ...]


def scoreboard(results: Results) -> dict[str, list[Line]]:
    """Returns all goals by part of the pipeline, with what was measured."""
    parts: dict[str, list[Line]] = {}
    for goal in GOALS:
        scores = tuple(_score(goal, goal.measure(results, robot)) for robot in ROBOTS)
        parts.setdefault(goal.part, []).append(Line(goal, scores))
    return parts


def counts(parts: dict[str, list[Line]]) -> dict[str, dict[str, int]]:
    """Returns how many goals each robot met, and how many were measured."""
    lines = [line for part in parts.values() for line in part]
    result = {}
    for place, robot in enumerate(ROBOTS):
        verdicts = [line.scores[place].verdict for line in lines]
        result[robot] = {
            "met": sum(verdict in (MET, BEST) for verdict in verdicts),
            "measured": sum(verdict != UNKNOWN for verdict in verdicts),
            "goals": len(verdicts),
        }
    return result


def _score(goal: Goal, measured: Measured | None) -> Score:
    verdict = goal.verdict(measured)
    if measured is None:
        return Score(Cell(NOTHING), verdict)
    notes = []
    if measured.low is not None and measured.high is not None:
        low, high = (number(x, goal.digits) for x in (measured.low, measured.high))
        notes.append(f"{low}–{high}")
    if measured.price:
        notes.append(measured.price)
    return Score(Cell(number(measured.value, goal.digits), "; ".join(notes)), verdict)
