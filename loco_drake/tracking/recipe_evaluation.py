"""Evaluation of a recipe's policy on the way, without the noise of its training."""

from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import fmean

from loco_drake.common.errors import InputError
from loco_drake.common.files import read_json, write_json
from loco_drake.common.typed import FieldError, convert
from loco_drake.control.actor_file import load_actor
from loco_drake.control.plan import Plan
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import FPS
from loco_drake.tracking.exact_return import exact_returns
from loco_drake.tracking.recipe import Recipe
from loco_drake.tracking.recipe_parts import Evaluation
from loco_drake.tracking.references import load_references

RESULT = "result"  # stands for the stage of a policy of two stages' networks
GOAL = 90.0  # normalized return whose first time is noted


@dataclass(frozen=True, kw_only=True)
class Point:
    """Normalized returns, 0 to 100, of the policy after some steps."""

    steps: int  # of all stages so far
    stage: str  # that they ended in
    mean_return: float  # over labels
    by_label: dict[str, float]


@dataclass(frozen=True, kw_only=True)
class _File:
    points: list[Point]


class Evaluator:
    """Evaluates policies, and notes their returns in a file.

    Args:
        recipe: its robot and plant; it has an evaluation.
        motions: folder of the Motion files to evaluate on.
        file: JSON, with the points of before, if there are any.
    """

    def __init__(self, recipe: Recipe, motions: Path, file: Path) -> None:
        assert recipe.evaluation is not None
        self._recipe, self._motions, self._file = recipe, motions, file
        self._evaluation: Evaluation = recipe.evaluation
        self._plans: list[Plan] = []
        self._points = read_points(file)

    def is_due(self, steps: int) -> bool:
        """Says whether so many steps of all stages are enough for another point."""
        last = self._points[-1].steps if self._points else 0
        return steps // self._evaluation.every > last // self._evaluation.every

    def evaluate(self, steps: int, stage: int | None, policy: Path) -> None:
        """Notes the returns of a policy after ``steps`` of all stages, once.

        ``stage`` is the one that it comes from; None for the recipe's result of two.
        """
        name = RESULT if stage is None else self._recipe.stages[stage].name
        last = len(self._recipe.stages) - 1
        if (steps, name) in {(point.steps, point.stage) for point in self._points}:
            return
        robot = get_robot(self._recipe.robot)
        if not self._plans:
            self._plans = load_references(robot, self._motions)
        returns = exact_returns(
            load_actor(policy, robot),
            self._plans,
            round(self._evaluation.motions.seconds * FPS),
            self._recipe.training(last if stage is None else stage).environment.plant,
        )
        point = Point(
            steps=steps,
            stage=name,
            mean_return=round(fmean(returns.values()), 2),
            by_label={label: round(x, 2) for label, x in returns.items()},
        )
        self._points.append(point)
        write_json(self._file, asdict(_File(points=self._points)))


def read_points(file: Path) -> list[Point]:
    """Returns the points in a file, in the order of their steps; none if it is missing.

    Raises:
        InputError: if the file is damaged.
    """
    if not file.is_file():
        return []
    try:
        found: _File = convert(read_json(file), _File)
    except FieldError as error:
        raise InputError(f"{file} is damaged: {error}.") from None
    return found.points


def steps_to_goal(points: list[Point]) -> int | None:
    """Returns the steps of the first point with a return of at least GOAL."""
    return next((x.steps for x in points if x.mean_return >= GOAL), None)
