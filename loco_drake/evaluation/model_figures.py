"""Scores of a robot's motion model, or of Motion files.

Figures that cannot be measured are null, with a ``reason``.
"""

import time
from collections.abc import Sequence
from typing import Any

from loco_drake.common.errors import InputError
from loco_drake.evaluation import drift as drifting
from loco_drake.evaluation.effort import Effort
from loco_drake.evaluation.generation import Generated
from loco_drake.evaluation.motion_scores import NULL_FIGURES
from loco_drake.evaluation.recorded import Recorded
from loco_drake.evaluation.samples import FRAMES, SECONDS, by_label, cut
from loco_drake.evaluation.tokenizer import pair_up, transfer_rmse
from loco_drake.generation.generate import generate_motion, generate_motions
from loco_drake.generation.motion_model import MotionModel
from loco_drake.motion.gaits import GaitLabel, parse_label
from loco_drake.motion.motion import Motion

TIMED_SECONDS = 10.0
NOT_TRAINED = "The generator was not trained on this label."
ONLY_FILES = "Motion files were scored, not a generator."


def known_labels(model: MotionModel, labels: Sequence[str]) -> list[GaitLabel]:
    """Returns those of the labels that a model was trained on.

    Raises:
        InputError: if there is none.
    """
    trained = model.generator.config.labels
    known = [parse_label(name) for name in labels if name in trained]
    if not known:
        raise InputError(
            f"The generator was trained on none of {', '.join(labels)}; "
            f"it was on {', '.join(trained)}."
        )
    return known


def generate_for_scoring(
    model: MotionModel, labels: Sequence[GaitLabel], effort: Effort, seed: int
) -> Generated:
    """Generates what is scored, of labels that the model knows."""

    def generate(seconds: float, first: int, count: int) -> list[Motion]:
        seeds = range(first, first + count)
        made = [generate_motions(model, label, seconds, seeds) for label in labels]
        return [motion for own in made for motion in own]

    sets = []
    for number in range(effort.generator_seeds):
        made = generate(SECONDS, seed + number * effort.count, effort.count)
        # A motion of 2 s ends with one frame more than 2 s of frames.
        sets.append(tuple(motion.slice(0, FRAMES) for motion in made))
    minutes = effort.minutes > 1
    long = generate(drifting.SECONDS, seed, effort.minutes) if minutes else []
    return Generated(tuple(sets), by_label(long))


def cut_for_scoring(motions: Sequence[Motion]) -> Generated:
    """Cuts motions from anywhere into what is scored; a minute or more tells the drift.

    Raises:
        InputError: if no motion is as long as a trajectory.
    """
    cuts = cut(motions)
    if not cuts:
        raise InputError(f"No motion to score is {SECONDS:g} s long or longer.")
    long = by_label(m for m in motions if m.duration >= drifting.SECONDS)
    return Generated((tuple(cuts),), long)


def add_model_figures(
    figures: dict[str, Any],
    model: MotionModel | None,
    labels: Sequence[str],
    recorded: Recorded,
    other_robot: Recorded | None,
) -> None:
    """Adds to the figures of motion those of the model that wrote it.

    Args:
        figures: figures from :func:`.generation.score_generation`.
        model: the model; None if Motion files were scored.
        labels: requested labels; the model need not know all.
        recorded: recordings retargeted to the model's robot.
        other_robot: the same retargeted to the other robot, if the tokenizer knows it.
    """
    reasons = figures["reason"]
    for name in ("transfer_joint_rmse_rad", "real_time_factor"):
        figures[name], reasons[name] = None, ONLY_FILES
    if model is None:
        return
    label = known_labels(model, labels)[0]
    figures["real_time_factor"] = real_time_factor(model, label)
    del reasons["real_time_factor"]
    missing = {**NULL_FIGURES, "reason": NOT_TRAINED}
    figures["labels"] = {name: figures["labels"].get(name, missing) for name in labels}
    if other_robot is None:
        robots = ", ".join(model.tokenizer.config.robots)
        reasons["transfer_joint_rmse_rad"] = f"The tokenizer knows only {robots}."
    elif pairs := _pairs(model, recorded, other_robot):
        figures["transfer_joint_rmse_rad"] = transfer_rmse(model.tokenizer, pairs)
        del reasons["transfer_joint_rmse_rad"]
    else:
        reasons["transfer_joint_rmse_rad"] = "No recording is held out."


def _pairs(
    model: MotionModel, recorded: Recorded, other: Recorded
) -> list[tuple[Motion, Motion]]:
    """Returns what to decode for the other robot; for a robot that was added, its."""
    sides = recorded.validation, other.validation
    if model.robot.name in model.tokenizer.config.added:
        sides = sides[::-1]
    return pair_up(*sides)


def real_time_factor(model: MotionModel, label: GaitLabel) -> float:
    """Returns the real-time factor of generating one motion, after a warm-up."""
    generate_motion(model, label, 1.0, 0)
    start = time.perf_counter()
    generate_motion(model, label, TIMED_SECONDS, 0)
    return TIMED_SECONDS / (time.perf_counter() - start)
