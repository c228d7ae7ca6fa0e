"""What the ``evaluate`` commands share."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from loco_drake.common.errors import InputError, check_choice
from loco_drake.common.files import atomic_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def of_robots(
    robot: str, evaluate: Callable[[str], dict[str, Any]], keys: Iterable[str]
) -> dict[str, Any]:
    """Returns the figures of ``robot``, or of all by name.

    With "all", the figures of a robot that cannot be evaluated are null, and its
    "reason" says why; if none can, that is an error.

    Args:
        robot: a name, or "all".
        evaluate: returns the figures of one robot.
        keys: of the figures.

    Raises:
        InputError: from ``evaluate``.
    """
    from loco_drake.models.robots import ROBOTS

    check_choice("robot", robot, (*ROBOTS, "all"))
    if robot != "all":
        return {"robot": robot, **evaluate(robot)}
    results: dict[str, dict[str, Any]] = {}
    errors = []
    for name in ROBOTS:
        try:
            results[name] = evaluate(name)
        except InputError as error:
            errors.append(error)
            results[name] = {**dict.fromkeys(keys), "reason": str(error)}
    if len(errors) == len(ROBOTS):
        raise errors[0]
    return {"robots": results}


def robot_names(result: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Returns name and figures of each robot in what :func:`of_robots` returns."""
    if "robots" in result:
        return list(result["robots"].items())
    return [(result["robot"], result)]


def estimate_text(estimate: dict[str, float] | None) -> str:
    """Returns an estimate as ``.950 [.910, .980]``."""
    if estimate is None:
        return "-"
    mean, low, high = (estimate[key] for key in ("mean", "low", "high"))
    return f"{mean:.3f} [{low:.3f}, {high:.3f}]"


def write_figure(figure: "Figure", path: Path) -> None:
    """Writes a picture, wholly or not at all."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=120)
