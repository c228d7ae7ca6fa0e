"""From a folder of results to a page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from loco_drake.common.errors import check_choice
from loco_drake.evaluation.report.page import render
from loco_drake.evaluation.report.replays import (
    Replay,
    record_replays,
    trained_labels,
)
from loco_drake.evaluation.report.results import load_results
from loco_drake.evaluation.report.scoreboard import counts, scoreboard
from loco_drake.generation.generate import generate_motion
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.robots import ROBOTS
from loco_drake.motion.gaits import GaitLabel, parse_label
from loco_drake.motion.motion import Motion

STRIP_SECONDS = 1.0  # of motion for an outline; a little more than is shown
DEFAULT_REPLAYS = ("dog-trot", "horse-trot", "mpc-bound", "solo8-walk")
_NO_POLICY = "no policy for this robot comes with the package yet"


@dataclass(frozen=True)
class Report:
    """A finished page.

    Attributes:
        html: the page.
        counts: of goals, by robot.
        missing: results that are missing by file, with the command that makes each.
        replays: robot and gait of each replay.
        unavailable: robots without replays, and why.
    """

    html: str
    counts: dict[str, dict[str, int]]
    missing: dict[str, str]
    replays: list[tuple[str, str]] = field(default_factory=list)
    unavailable: dict[str, str] = field(default_factory=dict)


def build_report(
    folder: Path,
    labels: Sequence[str],
    seconds: float,
    seed: int,
    say: Callable[[str], None] = lambda text: None,
) -> Report:
    """Returns the page of a folder of results.

    Args:
        folder: as :func:`.results.load_results` reads it.
        labels: of the replays, for each robot that has a policy; may be empty.
        seconds: of each replay.
        seed: of the motion shown.
        say: is told what goes on.

    Raises:
        InputError: if a result is damaged, or a label is unknown.
    """
    for label in labels:
        parse_label(label)
    results = load_results(folder)
    goals = scoreboard(results)
    say("Generating motion of each gait")
    motions = {robot: _motions(robot, seed) for robot in ROBOTS}
    replays: list[Replay] = []
    unavailable: dict[str, str] = {}
    if labels:
        trained = trained_labels()
        for robot in ROBOTS:
            if robot not in trained:
                unavailable[robot] = _NO_POLICY
                continue
            for label in labels:
                check_choice(f"gait of the {robot}'s policy", label, trained[robot])
            for replay in record_replays(robot, labels, seconds, seed):
                say(f"Simulated {robot}, {replay.label}")
                replays.append(replay)
    counted = counts(goals)
    html = render(results, goals, counted, motions, replays, unavailable)
    return Report(
        html=html,
        counts=counted,
        missing={file.path: file.command for file in results.missing},
        replays=[(replay.robot, replay.label) for replay in replays],
        unavailable=unavailable,
    )


def _motions(robot: str, seed: int) -> list[Motion]:
    """Returns a motion of each gait that the shipped generator knows."""
    model = pretrained_motion_model(robot)
    labels: list[GaitLabel] = [
        parse_label(name) for name in model.generator.config.labels
    ]
    return [generate_motion(model, label, STRIP_SECONDS, seed) for label in labels]
