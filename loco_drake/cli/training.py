"""Steps that the ``train`` commands share."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import tyro

from loco_drake.cli.options import Device, Json, option
from loco_drake.cli.output import do_all, print_table, say, write_json, write_results
from loco_drake.cli.parsing import parse
from loco_drake.common.errors import InputError
from loco_drake.common.progress import progress_bar
from loco_drake.generation.loop_settings import LoopSettings

if TYPE_CHECKING:
    from loco_drake.control.plan import Plan
    from loco_drake.generation.training import LoopResult

SCORED = 2000  # clips of a library that a network is scored on, at most
# Options that are not the run's: where it is, and what a call does.
_OF_THE_CALL = ("out", "resume", "json", "start_from")
# Where it learned from may be elsewhere now: what is there is compared.
_FOLDERS = (
    *("motions", "references", "robot"),
    *("tokenizer", "tell", "add_to", "fine_tune"),
)


class Scores(NamedTuple):
    """What a network has learned: figures for JSON, and a table."""

    figures: dict[str, Any]
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""  # behind the name of the weights file


# Trains on plans; calls the function that it is given with the steps so far and the
# mean normalized returns of recent episodes by label, and returns figures.
TrainPolicy = Callable[
    ["list[Plan]", Callable[[int, dict[str, float]], None]], dict[str, Any]
]


# How a training ended, and what scores the network.
Learned = tuple["LoopResult", Callable[[], Scores]]


@dataclass(kw_only=True)
class NetworkTraining(LoopSettings):
    """Base of the commands that train a network, which is called NAME."""

    NAME: ClassVar[str]
    device: Device = "cpu"
    # Robot: the YAML file of one that motion is of, see docs/own_robot.md; may be
    # repeated. go2 and a1 are known.
    robot: Annotated[
        tuple[str, ...], tyro.conf.UseAppendAction, option(metavar="ROBOT|FILE")
    ] = ()
    json: Json = None

    def run(self) -> int:
        """Trains, prints and writes; returns 1 if it was stopped early, else 0."""
        from loco_drake.common.device import find_device
        from loco_drake.common.run_folder import check_folder
        from loco_drake.models.robots import get_robot

        self.check()
        find_device(self.device)
        for definition in self.robot:
            get_robot(definition)
        weights = self.out / f"{self.NAME}.safetensors"
        check_folder(self.out, weights.name, self.resume)
        result, score = self.learn()
        if result.stopped:
            return print_stopped(result.steps, self.steps)
        scores = score()
        training = {"steps": result.steps, "wall_clock_s": result.seconds}
        title = f"{weights}{scores.title}"
        do_all(
            lambda: print_table(title, scores.columns, scores.rows),
            lambda: write_json(self.json, {**training, **scores.figures}),
        )
        return 0

    @property
    def scratch(self) -> Path:
        """A folder that exists, on the disk that the run will be on."""
        return next(path for path in (self.out, *self.out.parents) if path.is_dir())

    def learn(self) -> Learned:
        """Reads the motions and trains."""
        raise NotImplementedError


def train_policy(command: Any, train: TrainPolicy) -> int:
    """Trains a policy on ``command.references``, shows progress, prints and writes.

    Returns 1 if it was stopped early, else 0.

    Raises:
        InputError: if there are no such references.
    """
    from loco_drake.models.robots import get_simulated
    from loco_drake.tracking.references import load_references

    if command.references is None:
        raise InputError("--motions must name a folder of Motion files.")
    robot = get_simulated(command.environment.robot)
    plans = load_references(robot, command.references)
    with progress_bar() as bar:
        task = bar.add_task(command.NAME, total=command.steps, note="")

        def report(steps: int, scores: dict[str, float]) -> None:
            note = f"return {fmean(scores.values()):.1f} of 100"
            bar.update(task, completed=steps, note=note)

        figures = train(plans, report)
    rows = [(label, f"{score:.1f}") for label, score in figures["scores"].items()]
    title = "Recent training returns, of 100"
    do_all(
        lambda: print_table(title, ("gait", "return"), rows),
        lambda: write_results(command.json, figures),
    )
    if figures["interrupted"]:
        saved = figures.get("saved", figures["steps"] > 0)
        return print_stopped(figures["steps"], command.steps, saved=saved)
    return 0


def parse_resumed(command: Any, name: str, args: Sequence[str]) -> Any:
    """Returns a command that resumes; options that are not given are those of the run.

    ``command`` was parsed from the same arguments with the defaults of its class.

    Raises:
        InputError: if there is no sound checkpoint of such a training, or an option
            contradicts it.
    """
    from loco_drake.common import run_folder

    if getattr(command, "start_from", None) is not None:
        raise InputError("Give either --start-from or --resume, not both.")
    run_folder.check_folder(command.out, run_folder.CHECKPOINT, resume=True)
    path = command.out / run_folder.CHECKPOINT
    saved = run_folder.read_checkpoint(path, command.NAME)
    own = {k: v for k, v in saved.options.items() if k not in _OF_THE_CALL}
    with run_folder.sound(path):
        default = run_folder.with_options(command, own)
    parsed = parse(type(command), name, args, default)
    options = run_folder.options_of(parsed)
    own = run_folder.settings(options, *_OF_THE_CALL, *_FOLDERS)
    run_folder.check_same(saved, own, own, parsed.steps)
    return parsed


def print_stopped(done: int, steps: int, *, saved: bool = True) -> int:
    """Prints how to resume on stderr; returns the exit status of unfinished work."""
    how = "the same command with --resume goes on" if saved else "nothing is saved yet"
    say(f"Stopped after {done} of {steps} steps; {how}.")
    return 1
