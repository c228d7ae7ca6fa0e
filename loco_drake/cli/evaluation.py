"""Options and steps that the ``evaluate`` commands share."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from loco_drake.cli.options import (
    DataDir,
    Json,
    UnusedSeed,
    WorkerOptions,
    option,
    some_labels,
)
from loco_drake.cli.output import do_all, print_failed, print_table, say, write_results
from loco_drake.common.errors import InputError, check_at_least, check_choice, one_line
from loco_drake.motion.gaits import parse_label

if TYPE_CHECKING:
    from loco_drake.evaluation.recorded import Recorded
    from loco_drake.evaluation.report.tables import Table
    from loco_drake.models.robots import Robot


@dataclass(kw_only=True)
class Evaluation(WorkerOptions):
    """Base of the evaluations of Go2 and A1; KEYS are the keys of a robot's figures."""

    KEYS: ClassVar[tuple[str, ...]]

    # Robot: go2, a1, all, or a YAML file, see docs/own_robot.md.
    robot: Annotated[str, option(metavar="ROBOT|FILE")] = "go2"
    labels: Annotated[tuple[str, ...], some_labels("all with recordings")] = ()
    data_dir: DataDir = None
    # Number of seeds, counted up from --seed: accepted by every evaluation; this one is
    # deterministic.
    seeds: int = 1
    seed: UnusedSeed = 0
    json: Json = None

    def run(self) -> int:
        """Prints tables, writes the figures and draws; returns the exit status."""
        self.check()
        result = self.of_robots(self.robots())
        robots = result.get("robots", {self.robot: result})
        statuses = []

        def show() -> None:
            for name, figures in robots.items():
                statuses.append(self.show(name, figures))

        do_all(
            show,
            lambda: write_results(self.json, result),
            *(partial(self.draw, *item) for item in robots.items()),
        )
        return max(statuses)

    def draw(self, name: str, figures: dict[str, Any]) -> None:
        """Writes the pictures of a robot, if there are any."""

    def check(self) -> None:
        """Raises InputError if an option is wrong."""
        for name, least in (("seeds", 1), ("seed", 0)):
            check_at_least(name, getattr(self, name), least)
        _ = self.executor  # checks its options

    def robots(self) -> list[str]:
        """Returns the names of the robots; raises InputError if they are unknown."""
        from loco_drake.models.robot_files import is_robot_file
        from loco_drake.models.robots import ROBOTS, get_robot

        if is_robot_file(self.robot):
            # From here on its name stands for it.
            self.robot = get_robot(self.robot).name
            return [self.robot]
        check_choice("robot", self.robot, (*ROBOTS, "all"))
        return list(ROBOTS) if self.robot == "all" else [self.robot]

    def of_robots(self, names: list[str]) -> dict[str, Any]:
        """Returns the figures of one robot, or of all by name.

        Of several, the figures of a robot that cannot be evaluated are null, and its
        "reason" says why; if none can, that is an error.
        """
        for label in self.labels:
            parse_label(label)
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

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints figures of a robot; returns the exit status."""
        raise NotImplementedError

    def retarget(self, robot: "Robot", ground: bool = False) -> "Recorded":
        """Returns the recordings as motion of a robot; says which failed.

        The motion is made to obey physics if ``ground``.
        """
        from loco_drake.datasets.registry import data_dir
        from loco_drake.evaluation.recorded import retarget_recordings

        folder = data_dir(self.data_dir)
        grounding = " and grounding" if ground else ""
        say_of(robot.name)(f"Retargeting{grounding} the recordings")
        recorded = retarget_recordings(
            folder, robot, self.labels, self.executor, ground=ground
        )
        print_failed(recorded.failed.items())
        return recorded


@dataclass(kw_only=True)
class SimulatedEvaluation(Evaluation):
    """Base of the evaluations that simulate.

    Nothing is simulated before it is known that everything can be.
    """

    def of_robots(self, names: list[str]) -> dict[str, Any]:
        """Returns the figures of one robot, or of all by name."""
        prepared = {name: self.prepare(name) for name in names}
        results = {name: self.evaluate(name, *prepared[name]) for name in names}
        return results.get(self.robot, {"robots": results})

    def prepare(self, name: str) -> tuple[Any, Any]:
        """Returns the scenario of a robot, and what to simulate in it."""
        raise NotImplementedError

    def evaluate(self, name: str, scenario: Any, work: Any) -> dict[str, Any]:
        """Returns the figures of one robot."""
        raise NotImplementedError


def say_of(robot: str) -> Callable[[str], None]:
    """Returns a function that prints progress for a robot on stderr."""
    return lambda text: say(f"{robot}: {text}")


def trained_on(
    paths: Mapping[str, Path], recorded: "Recorded", robot: str
) -> dict[str, list[str] | None]:
    """Returns validation subjects that weights were trained on, and warns of them.

    They are by kind, "tokenizer" or "generator", as the paths are; None where the
    weights do not say.
    """
    from loco_drake.generation import training_motions

    result = {}
    for kind, path in paths.items():
        record = training_motions.read_training_record(path, kind)
        seen = training_motions.seen_in_training(record, recorded.validation)
        result[kind] = seen
        if seen is None:
            say_of(robot)(f"What the {kind} was trained on is not recorded in {path}.")
        elif seen:
            text = f"The {kind} was trained on recordings of validation: "
            say_of(robot)(f"Warning: {text}{', '.join(seen)}.")
    return result


def print_by_label(
    title: str, kinds: Sequence[str], rows: Mapping[str, Mapping[str, Any]]
) -> None:
    """Prints figures by label, in columns of the ``kinds`` in the report's content."""
    from loco_drake.evaluation.report.content import CONTENT
    from loco_drake.evaluation.report.figures import Figures
    from loco_drake.evaluation.report.tables import figures_table

    found = {name: Figures(dict(figures)) for name, figures in rows.items()}
    columns = [column for kind in kinds for column in CONTENT.columns[kind]]
    print_report(figures_table(title, "label", columns, found))


def print_report(table: "Table") -> None:
    """Prints a table of the report."""
    columns = list(table.columns)
    if table.groups:
        share = len(columns) // len(table.groups)
        columns = [f"{table.groups[i // share]}: {c}" for i, c in enumerate(columns)]
    rows = [
        (row.title, *(f"{cell.text} {cell.note}".strip() for cell in row.cells))
        for row in table.rows
    ]
    print_table(table.title, (table.first, *columns), rows)
    for text in filter(None, (table.note, *table.reasons)):
        print(one_line(text))
