"""Options and steps that the ``evaluate`` commands share."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import Console

from loco_drake.cli.output import write_results
from loco_drake.common.errors import InputError, check_at_least, check_choice
from loco_drake.common.files import atomic_path
from loco_drake.motion.gaits import parse_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from loco_drake.evaluation.recorded import Recorded


@dataclass(kw_only=True)
class Evaluation:
    """Base of the evaluations of Go2 and A1; KEYS are the keys of a robot's figures."""

    KEYS: ClassVar[tuple[str, ...]]

    robot: str = "go2"
    """Robot: go2, a1 or all."""
    labels: tuple[str, ...] = ()
    """Gait labels, such as dog-trot dog-pace. Default: all of the fifteen with
    recordings."""
    data_dir: Path | None = None
    """Folder of the recordings. Default: $LOCO_DRAKE_DATA, else the user's cache
    folder."""
    workers: int = 1
    """Number of worker processes."""
    seed: int = 0
    """Accepted by every command; this one uses no random numbers."""
    json: Path | None = None
    """Write the figures to this JSON file."""

    def run(self) -> int:
        """Prints tables for each robot and writes the figures; returns 0.

        Raises:
            InputError: if an option is wrong, or there is nothing to evaluate.
        """
        from loco_drake.models.robots import ROBOTS

        check_choice("robot", self.robot, (*ROBOTS, "all"))
        check_at_least("workers", self.workers, 1)
        check_at_least("seed", self.seed, 0)
        for label in self.labels:
            parse_label(label)
        self.check()
        result = self.of_robots(list(ROBOTS) if self.robot == "all" else [self.robot])
        write_results(self.json, result)
        for name, figures in result.get("robots", {self.robot: result}).items():
            self.show(name, figures)
        return 0

    def check(self) -> None:
        """Raises InputError if an option of this command is wrong."""

    def of_robots(self, names: list[str]) -> dict[str, Any]:
        """Returns the figures of one robot, or of all by name.

        Of several, the figures of a robot that cannot be evaluated are null, and its
        "reason" says why; if none can, that is an error.
        """
        if len(names) == 1:
            return {"robot": names[0], **self.of_robot(names[0])}
        results: dict[str, dict[str, Any]] = {}
        errors = []
        for name in names:
            try:
                results[name] = self.of_robot(name)
            except InputError as error:
                errors.append(error)
                results[name] = {**dict.fromkeys(self.KEYS), "reason": str(error)}
        if len(errors) == len(names):
            raise errors[0]
        return {"robots": results}

    def of_robot(self, name: str) -> dict[str, Any]:
        """Returns the figures of one robot."""
        raise NotImplementedError

    def show(self, name: str, figures: dict[str, Any]) -> None:
        """Prints what :meth:`of_robot` returned."""
        raise NotImplementedError


def say_of(robot: str) -> Callable[[str], None]:
    """Returns what prints on stderr what goes on with a robot."""
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    return lambda text: console.print(f"{robot}: {text}", markup=False)


def trained_on(
    paths: Mapping[str, Path], recorded: "Recorded", robot: str
) -> dict[str, list[str] | None]:
    """Returns which recordings of validation weights were trained on; warns of them.

    Args:
        paths: weights by kind, "tokenizer" or "generator".
        recorded: retargeted recordings.
        robot: named in the warning.

    Returns:
        Names of subjects by kind; None where the weights do not say.
    """
    from loco_drake.generation.training_record import (
        read_training_record,
        seen_in_training,
    )

    result = {}
    for kind, path in paths.items():
        record = read_training_record(path, kind)
        seen = result[kind] = seen_in_training(record, recorded.validation)
        if seen is None:
            say_of(robot)(f"What the {kind} was trained on is not recorded in {path}.")
        elif seen:
            text = f"The {kind} was trained on recordings of validation: "
            say_of(robot)(f"Warning: {text}{', '.join(seen)}.")
    return result


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
