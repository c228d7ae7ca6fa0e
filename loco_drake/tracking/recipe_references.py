"""The motions that a recipe trains on, made once."""

import json
from collections.abc import Callable
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path

from loco_drake.common.errors import InputError
from loco_drake.common.files import read_json, write_json
from loco_drake.control.motion_batches import batches, finished
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import MotionModel, load_motion_model
from loco_drake.models.robots import Robot
from loco_drake.models.shipped import network_path
from loco_drake.motion.motion import FPS
from loco_drake.motion.motion_file import save_motion
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.tracking.recipe_parts import ReferenceSet
from loco_drake.tracking.references import read_motions

# Says what a folder holds, and whether all of it is there.
MARK = "references.json"


def make_references(
    robot: Robot,
    references: ReferenceSet,
    folder: Path,
    report: Callable[[int, int], None] = lambda done, total: None,
    stopped: Callable[[], bool] = lambda: False,
    tokenizer: Path | None = None,
) -> bool:
    """Writes the motions of a set to ``folder``, if they are not there yet.

    Killed anywhere, it goes on from the last batch of motions that was complete.

    Args:
        robot: the robot.
        references: what to make.
        folder: for the Motion files and ``references.json``.
        report: is told how many of how many are there.
        stopped: asked before each batch.
        tokenizer: by default the shipped one, or the robot's own.

    Returns:
        Whether all motions are there now.

    Raises:
        InputError: if the folder holds other references, or was begun with other
            weights.
    """
    asked = json.loads(json.dumps(asdict(references), default=str))
    mark, found = folder / MARK, {}
    if mark.is_file():
        found = read_json(mark)
        # Of before a field there was, it has the default.
        if {**asdict(ReferenceSet()), **found.get("set", {})} != asked:
            raise InputError(
                f"{str(folder)!r} holds other references than the recipe asks for; "
                "begin in another folder with --out."
            )
        if found.get("complete") is True:
            return True
    files = {
        "tokenizer": tokenizer or network_path(robot, "tokenizer"),
        "generator": network_path(robot, "generator"),
    }
    made_by = {x: sha256(path.read_bytes()).hexdigest() for x, path in files.items()}
    made = {"set": asked, "made_by": made_by if references.folder is None else {}}
    if found and found.get("made_by") != made["made_by"]:
        raise InputError(
            f"{str(folder)!r} was begun with other weights of tokenizer and generator; "
            "begin in another folder with --out."
        )
    write_json(mark, {**made, "complete": False})
    for unfinished in folder.glob(".*.npz"):
        unfinished.unlink()  # left by a process that was killed
    if references.folder is None:
        model = load_motion_model(**files, robot=robot.definition)
        complete = _generate(model, references, folder, report, stopped)
    else:
        complete = _copy(robot, references, folder, report, stopped)
    if complete:
        write_json(mark, {**made, "complete": True})
    return complete


def _generate(
    model: MotionModel,
    references: ReferenceSet,
    folder: Path,
    report: Callable[[int, int], None],
    stopped: Callable[[], bool],
) -> bool:
    robot = model.robot
    solver = LegSolver(robot, FPS) if references.grounded else None
    total, done = len(references.gaits) * references.count, 0
    for label in references.gaits:
        for seeds in batches(references.first_seed, references.count):
            if stopped():
                return False
            paths = [folder / f"{label}-{seed}.npz" for seed in seeds]
            if not all(path.is_file() for path in paths):
                motions = generate_motions(model, label, references.seconds, seeds)
                for seed, path, motion in zip(seeds, paths, motions, strict=True):
                    steer = references.steered
                    made = finished(motion, robot, seed, steer=steer, solver=solver)
                    save_motion(made, path)
            done += len(seeds)
            report(done, total)
    return True


def _copy(
    robot: Robot,
    references: ReferenceSet,
    folder: Path,
    report: Callable[[int, int], None],
    stopped: Callable[[], bool],
) -> bool:
    assert references.folder is not None
    motions = read_motions(robot, references.folder)
    for done, (path, motion) in enumerate(motions.items()):
        if stopped():
            return False
        save_motion(motion, folder / path.name)
        report(done + 1, len(motions))
    return True
