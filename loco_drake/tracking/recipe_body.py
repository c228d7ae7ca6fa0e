"""Teaching the tokenizer a robot that it does not know, without recordings.

The shipped generator writes motion of the Go2, which is retargeted to the robot as that
of an animal is. From both, whose tokens are the same, the tokenizer learns the robot's
body.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from loco_drake.common.run_folder import CHECKPOINT
from loco_drake.generation.generate import generate_motion
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.generation.tokenizer import load_tokenizer
from loco_drake.generation.train_bodies import train_bodies
from loco_drake.generation.training_motions import load_library
from loco_drake.models.robots import Robot
from loco_drake.models.shipped import network_path
from loco_drake.motion.motion import FPS
from loco_drake.motion.motion_file import save_motion
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.robot_clip import retarget_motion
from loco_drake.retargeting.scaling import Variant
from loco_drake.tracking.recipe_parts import Body

KNOWN = "go2"  # the robot whose motion is retargeted
_WEIGHTS = "tokenizer.safetensors"
_LEARNING_RATE = 2e-3


def knows(robot: Robot) -> bool:
    """Returns whether the tokenizer that a robot is given by default knows its body."""
    config = load_tokenizer(network_path(robot, "tokenizer")).config
    return robot.name in config.robots


def tokenizer_in(out: Path) -> Path | None:
    """Returns the tokenizer that a run folder has, or None."""
    path = out / _WEIGHTS
    return path if path.is_file() else None


def make_body(
    robot: Robot,
    body: Body,
    motions: Path,
    out: Path,
    seed: int = 0,
    report: Callable[[int, int], None] = lambda done, total: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Path | None:
    """Teaches the robot's tokenizer its body, unless ``out`` has one that knows it.

    Killed anywhere, it goes on from the last motion or checkpoint.

    Args:
        robot: the robot.
        body: what to make and how long to train.
        motions: folder for the motions.
        out: run folder of the tokenizer's training.
        seed: of the training.
        report: is told how many motions of how many are there.
        stopped: asked before each motion.

    Returns:
        The tokenizer's file; None if it was stopped before it was complete.
    """
    if (made := tokenizer_in(out)) is not None:
        return made
    if not _make_motions(robot, body, motions, report, stopped):
        return None
    settings = LoopSettings(
        out=out,
        steps=body.steps,
        learning_rate=_LEARNING_RATE,
        seed=seed,
        resume=(out / CHECKPOINT).is_file(),
    )
    library = load_library(motions, scratch=motions)
    _, result = train_bodies(library, network_path(robot, "tokenizer"), settings)
    return None if result.stopped else tokenizer_in(out)


def _make_motions(
    robot: Robot,
    body: Body,
    folder: Path,
    report: Callable[[int, int], None],
    stopped: Callable[[], bool],
) -> bool:
    known, solver = pretrained_motion_model(KNOWN), LegSolver(robot, FPS)
    grounded = Variant(ground=True)
    done, total = 0, len(body.motions.gaits) * body.motions.count
    for unfinished in folder.glob(".*.npz"):
        unfinished.unlink()  # left by a process that was killed
    for label in body.motions.gaits:
        for seed in range(
            body.motions.first_seed, body.motions.first_seed + body.motions.count
        ):
            if stopped():
                return False
            names = [f"{name}-{label}-{seed}.npz" for name in (KNOWN, robot.name)]
            if not all((folder / name).is_file() for name in names):
                given = generate_motion(known, label, body.motions.seconds, seed)
                # By which the tokenizer's training finds what belongs together.
                origin = {"file": f"{label}-{seed}", "frames": f"0-{len(given)}"}
                given = replace(given, provenance={**given.provenance, **origin})
                moved, _ = retarget_motion(given, known.robot, robot, solver, grounded)
                for name, motion in zip(names, (given, moved), strict=True):
                    save_motion(motion, folder / name)
            done += 1
            report(done, total)
    return True
