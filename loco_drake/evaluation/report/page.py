"""Builds the page: one self-contained HTML file from a folder of results.

Replays are simulations of the shipped policies as Meshcat pages. Such a page contains a
viewer and meshes of several MB, and a recording of a few hundred kB. Replays of a robot
differ in the recording only, so common parts are stored once.
"""

import base64
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from PIL import Image
from pydrake.geometry import Meshcat

from loco_drake import __version__
from loco_drake.common.errors import InputError, check_choice
from loco_drake.control.actor_file import load_actor
from loco_drake.evaluation.library import read_library
from loco_drake.evaluation.report import pictures
from loco_drake.evaluation.report.content import CONTENT
from loco_drake.evaluation.report.goals import counts, scoreboard
from loco_drake.evaluation.report.results import (
    RETARGETED,
    Results,
    commands,
    load_results,
)
from loco_drake.evaluation.report.sections import all_tables, networks_table
from loco_drake.evaluation.report.tables import figure_cell, robot_title
from loco_drake.evaluation.tracking import (
    FRAMES_PER_SECOND,
    Recorder,
    tracking_metrics,
)
from loco_drake.evaluation.tracking_pictures import record_traces
from loco_drake.generation.generate import generate_motion
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.models.scenery import dress, publish_replay
from loco_drake.models.shipped import policy_path
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion import Motion
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy

STRIP_SECONDS = 1.0  # of motion for an outline; a little more than is shown
_PIECE = 2000  # characters


@dataclass(frozen=True)
class Replay:
    """A simulation that can be watched."""

    robot: str  # its name
    label: str  # the gait
    html: str  # a page of Meshcat that plays it
    fell: bool  # whether the robot did
    figures: dict[str, float]  # of loco_drake.evaluation.tracking.tracking_metrics


def build_report(
    folder: Path,
    labels: Sequence[str],
    seconds: float,
    seed: int,
    say: Callable[[str], None] = lambda text: None,
) -> tuple[str, dict[str, Any]]:
    """Returns the page of a folder of results, and what it holds, as JSON.

    Args:
        folder: folder of results, see :func:`.results.load_results`.
        labels: labels of the replays for each robot; without any nothing is simulated.
        seconds: duration of each replay.
        seed: seed of the motion shown.
        say: receives messages about the progress.

    Raises:
        InputError: if a result is damaged, or a label is unknown.
    """
    for label in labels:
        parse_label(label)
    results = load_results(folder)
    shown = of_results(results)
    for robot in map(get_robot, ROBOTS):
        trained = load_actor(policy_path(robot), robot).config.labels
        for label in labels:
            check_choice(f"gait of the {robot.name}'s policy", label, trained)
    say("Generating motion of each gait")
    motions = {name: _motions(name, seed) for name in ROBOTS}
    traces = None
    if labels:
        say("Simulating the shipped policies")
        traces = pictures.traces_picture(record_traces(ROBOTS, seed))
    replays: list[Replay] = []
    for name in ROBOTS if labels else ():
        for replay in record_replays(name, labels, seconds, seed):
            say(f"Simulated {name}, {replay.label}")
            replays.append(replay)
    return _render({**shown, "traces": traces}, motions, replays), {
        "goals": shown["counts"],
        "missing": {file.path: file.command for file in results.missing},
        "replays": [f"{replay.robot} {replay.label}" for replay in replays],
        "reason": {
            f"{robot} in {file}": why for (file, robot), why in results.absent.items()
        },
    }


def of_results(results: Results) -> dict[str, Any]:
    """Returns all that the page shows of results, by name.

    Raises:
        InputError: if a result is damaged.
    """
    goals = scoreboard(results)
    generation = results.of_robots("generation")
    tracking = results.of_robots("tracking-generated")
    learning = {
        robot: figures
        for robot, figures in results.of_robots("learning").items()
        if figures.numbers("learning", "steps")
    }
    steering = results.of_robots("steering")
    disturbed = results.of_robots("robustness")
    libraries = {
        robot: read_library(figures)
        for robot, figures in results.of_robots("retargeting").items()
        if figures.values.get("library") is not None
    }
    return {
        "goals": goals,
        "counts": counts(goals),
        "missing": results.missing,
        "absent": results.absent,
        "found": results.found,
        "commands": commands(results),
        **all_tables(results),
        "confusions": {
            robot: pictures.confusion_picture(figures, "transformer")
            for robot, figures in generation.items()
            if figures.values.get("confusion") is not None
        },
        "grids": {
            robot: pictures.grid_picture(figures)
            for robot, figures in steering.items()
            if figures.part("labels").values
        },
        "curves": pictures.curves_picture(disturbed) if disturbed else None,
        "returns": pictures.returns_picture(tracking) if tracking else None,
        "learning": pictures.learning_picture(learning) if learning else None,
        "retargeted": _retargeted(results),
        "retargeted_command": RETARGETED.command,
        # The robots' differ little.
        "library": next(
            (pictures.library_picture(*own) for own in libraries.items()), None
        ),
        "library_of": next(iter(libraries.items()), None),
    }


def _retargeted(results: Results) -> str | None:
    """Returns the picture RETARGETED as the address of an element, if it is there.

    Raises:
        InputError: if it is no picture.
    """
    if RETARGETED in results.missing:
        return None
    path = results.folder / RETARGETED.path
    try:
        with Image.open(path) as image:
            image.verify()
    except (OSError, SyntaxError, ValueError):
        raise InputError(f"{path} is no picture; draw it again.") from None
    return f"data:image/webp;base64,{base64.b64encode(path.read_bytes()).decode()}"


def _render(
    shown: dict[str, Any],
    motions: Mapping[str, Sequence[Motion]],
    replays: Sequence[Replay],
) -> str:
    environment = Environment(
        loader=PackageLoader("loco_drake.evaluation.report"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.globals.update(robot_title=robot_title, figure_cell=figure_cell)
    return environment.get_template("page.html").render(
        version=__version__,
        robots=ROBOTS,
        conditions=CONTENT.conditions,
        gaits=pictures.gaits_picture(motions),
        gait_count=len(next(iter(motions.values()))),
        networks=networks_table(),
        replays=replays,
        replay_data=share_pieces([replay.html for replay in replays]),
        **shown,
    )


def _motions(robot: str, seed: int) -> list[Motion]:
    """Returns a motion of each gait that the shipped generator knows."""
    model = pretrained_motion_model(robot)
    labels = map(parse_label, model.generator.config.labels)
    return [generate_motion(model, label, STRIP_SECONDS, seed) for label in labels]


def record_replays(
    robot: str, labels: Sequence[str], seconds: float, seed: int = 0
) -> Iterator[Replay]:
    """Simulates the shipped policy on generated motion, one gait after another.

    A replay lasts ``seconds``, or until the robot falls. There is at least one label,
    and the policy was trained on each.
    """
    scenario = Scenario(
        robot=robot,
        plant=PlantConfig(visual=True),
        reference=GeneratedReference(gait=labels[0], seed=seed, duration=seconds),
        policy=TrainedPolicy(),
    )
    meshcat = Meshcat()
    dress(meshcat)
    recorder = Recorder(scenario, meshcat, follow=True)
    for label in labels:
        meshcat.DeleteRecording()
        recorder.start(gait=label, seed=seed)
        meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
        rollout, _ = recorder.run(seconds)
        publish_replay(meshcat)
        figures = tracking_metrics(rollout)
        yield Replay(robot, label, meshcat.StaticHtml(), rollout.fell, figures)


def share_pieces(pages: Sequence[str]) -> dict[str, Any]:
    """Returns all pieces of all pages, each once, and of which each page is made.

    Joining the "pieces" that an entry of "pages" counts gives that page again. A line
    is cut into pieces: meshes get new names with each simulation, so that no long line
    is quite like another.
    """
    place: dict[str, int] = {}
    made = [
        [
            place.setdefault(line[start : start + _PIECE], len(place))
            for line in page.splitlines(keepends=True)
            for start in range(0, len(line), _PIECE)
        ]
        for page in pages
    ]
    return {"pieces": list(place), "pages": made}
