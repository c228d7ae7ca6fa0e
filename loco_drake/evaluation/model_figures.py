"""Scores of a robot's motion model, or of Motion files, with what they need.

What cannot be measured is null, and ``reason`` says why.
"""

import time
from collections.abc import Callable, Sequence

from loco_drake.common.errors import InputError
from loco_drake.evaluation import drift as drifting
from loco_drake.evaluation.effort import Effort
from loco_drake.evaluation.generation import (
    Generated,
    GenerationScore,
    score_generation,
)
from loco_drake.evaluation.motion_scores import NULL_FIGURES
from loco_drake.evaluation.recorded import Recorded
from loco_drake.evaluation.samples import FRAMES, SECONDS
from loco_drake.evaluation.transfer import pair_up, transfer_rmse
from loco_drake.generation.generate import generate_motion, generate_motions
from loco_drake.generation.motion_model import MotionModel
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import GaitLabel, parse_label
from loco_drake.motion.motion import Motion
from loco_drake.retargeting.trajectories import trajectories

TIMED_SECONDS = 10.0
NOT_TRAINED = "The generator was not trained on this label."
ONLY_FILES = "Motion files were scored, not a generator."


def generate_for_scoring(
    model: MotionModel, labels: Sequence[GaitLabel], effort: Effort, seed: int
) -> Generated:
    """Generates what :func:`score_generation` scores, of labels that it knows."""
    sets: list[list[Motion]] = [[] for _ in range(effort.generator_seeds)]
    long = {}
    for label in labels:
        for number, motions in enumerate(sets):
            first = seed + number * effort.count
            # A motion of 2 s ends with one frame more than 2 s of frames.
            made = generate_motions(
                model, label, SECONDS, range(first, first + effort.count)
            )
            motions += [motion.slice(0, FRAMES) for motion in made]
        if effort.minutes > 1:
            seeds = range(seed, seed + effort.minutes)
            long[str(label)] = generate_motions(model, label, drifting.SECONDS, seeds)
    return Generated(tuple(map(tuple, sets)), long)


def score_model(
    model: MotionModel,
    labels: Sequence[str],
    recorded: Recorded,
    other_robot: Recorded | None,
    effort: Effort,
    seed: int,
    say: Callable[[str], None],
) -> tuple[GenerationScore, Generated]:
    """Returns the figures of a motion model, and the motion that they are of.

    Args:
        model: to generate with.
        labels: asked for; the model need not know all.
        recorded: of the model's robot.
        other_robot: the same recordings retargeted to the other robot, if the
            tokenizer knows it.
        effort: how much to generate.
        seed: of the first motion, and of the first classifier.
        say: is told what goes on.

    Raises:
        InputError: if the model knows none of the labels.
    """
    trained = model.generator.config.labels
    known = [name for name in labels if name in trained]
    if not known:
        raise InputError(
            f"The generator was trained on none of {', '.join(labels)}; "
            f"it was on {', '.join(trained)}."
        )
    say(f"Generating {', '.join(known)}")
    generated = generate_for_scoring(
        model, [parse_label(k) for k in known], effort, seed
    )
    score = score_generation(
        model.robot,
        recorded,
        generated,
        seeds=range(seed, seed + effort.seeds),
        steps=effort.steps,
        say=say,
    )
    figures, reasons = score.figures, score.figures["reason"]
    if not generated.long:
        reasons["drift_60s"] = "Fewer than two motions of a minute were asked for."
    missing = {**NULL_FIGURES, "reason": NOT_TRAINED}
    figures["labels"] = {name: figures["labels"].get(name, missing) for name in labels}
    transfer = None
    if other_robot is None:
        robots = ", ".join(model.tokenizer.config.robots)
        reasons["transfer_joint_rmse_rad"] = f"The tokenizer knows only {robots}."
    else:
        pairs = pair_up(recorded.validation, other_robot.validation)
        transfer = transfer_rmse(model.tokenizer, pairs) if pairs else None
        if not pairs:
            reasons["transfer_joint_rmse_rad"] = "No recording is held out."
    figures["transfer_joint_rmse_rad"] = transfer
    figures["real_time_factor"] = real_time_factor(model, parse_label(known[0]))
    return score, generated


def score_motions(
    robot: Robot,
    motions: Sequence[Motion],
    recorded: Recorded,
    effort: Effort,
    seed: int,
    say: Callable[[str], None],
) -> tuple[GenerationScore, Generated]:
    """Returns the figures of motions from anywhere, and their trajectories.

    Trajectories of 2 s are cut from them; those of a minute or more tell the drift.

    Raises:
        InputError: if no motion is as long as a trajectory.
    """
    cuts = [part for motion in motions for part in trajectories(motion)]
    if not cuts:
        raise InputError(f"No motion to score is {SECONDS:g} s long or longer.")
    long: dict[str, list[Motion]] = {}
    for motion in motions:
        if motion.duration >= drifting.SECONDS:
            long.setdefault(str(motion.label), []).append(motion)
    generated = Generated((tuple(cuts),), long)
    score = score_generation(
        robot,
        recorded,
        generated,
        seeds=range(seed, seed + effort.seeds),
        steps=effort.steps,
        say=say,
    )
    figures = score.figures
    if figures["drift_60s"] is None:
        figures["reason"]["drift_60s"] = "No label has two motions of a minute."
    for name in ("transfer_joint_rmse_rad", "real_time_factor"):
        figures[name] = None
        figures["reason"][name] = ONLY_FILES
    return score, generated


def real_time_factor(model: MotionModel, label: GaitLabel) -> float:
    """Returns seconds of motion over seconds of writing it, one motion alone, warm."""
    generate_motion(model, label, 1.0, 0)
    start = time.perf_counter()
    generate_motion(model, label, TIMED_SECONDS, 0)
    return TIMED_SECONDS / (time.perf_counter() - start)
