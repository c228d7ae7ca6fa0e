"""Recorded motion of a robot as reference, split into training and validation sets."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from loco_drake.common.errors import InputError
from loco_drake.datasets.segments import read_segments, select_labels
from loco_drake.datasets.split import VALIDATION, Split
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.evaluation.samples import by_label, cut, labels_of
from loco_drake.models.robots import Robot, get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_folder import open_motions
from loco_drake.retargeting.retarget import SegmentRetargeter
from loco_drake.retargeting.scaling import Variant


@dataclass(frozen=True, eq=False)
class Recorded:
    """Retargeted stretches of recordings; no subject is on both sides."""

    train: tuple[Motion, ...]  # what models learn from
    validation: tuple[Motion, ...]  # what they have not seen
    # Stretches that could not be retargeted, and why.
    failed: dict[str, str] = field(default_factory=dict)

    def of(self, label: str) -> list[Motion]:
        """Returns all stretches of a label, of both sides."""
        return by_label((*self.train, *self.validation)).get(label, [])

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels that both sides have a trajectory of, in the order of LABELS."""
        return labels_of(*map(by_label, map(cut, (self.train, self.validation))))


def retarget_recordings(
    data_dir: Path,
    robot: Robot,
    labels: Iterable[str] = (),
    executor: Executor = LOCAL,
    *,
    ground: bool = False,
) -> Recorded:
    """Retargets the recordings of ``labels``, by default of all fifteen.

    Their motion is made to obey physics if ``ground``.

    Raises:
        InputError: if ``segments.csv`` in the folder is unsound, or lacks a label.
    """
    segments = read_segments(data_dir)
    names = {str(label) for label in LABELS}
    wanted = [s for s in select_labels(segments, labels) if s.label in names]
    variant = Variant(ground=ground)
    make = partial(SegmentRetargeter, robot, Split(segments), variant)
    motions, failed = [], {}
    for segment, made in zip(wanted, executor.map(make, wanted), strict=True):
        if isinstance(made, str):
            failed[segment.name] = made
        else:
            motions.append(made[1])
    return by_split(motions, failed)


def by_split(
    motions: Sequence[Motion], failed: dict[str, str] | None = None
) -> Recorded:
    """Returns motions in the sets that their provenance names.

    Motions without one are in the training set.
    """
    sides: dict[bool, list[Motion]] = {False: [], True: []}
    for motion in motions:
        sides[motion.provenance.get("split") == VALIDATION].append(motion)
    return Recorded(tuple(sides[False]), tuple(sides[True]), failed or {})


def load_to_score(
    folder: Path, robot: Robot, labels: Collection[str] = ()
) -> list[Motion]:
    """Reads the Motion files of a robot under ``folder``, of all or of these labels.

    Raises:
        InputError: if there are none, or one is unsound or at another rate than FPS.
    """
    motions = [
        motion
        for motion in open_motions(folder)
        if motion.robot == robot.name and (not labels or str(motion.label) in labels)
    ]
    if not motions:
        raise InputError(
            f"There are no Motion files (*.npz) of {robot.name} to score in "
            f"{str(folder)!r}."
        )
    for motion in motions:
        if motion.fps != FPS:
            raise InputError(
                f"Motions to score must be at {FPS:g} frames/s, one of "
                f"{motion.label} is at {motion.fps:g}."
            )
    return motions


def load_recorded(folder: Path) -> tuple[Robot, Recorded]:
    """Reads the Motion files under ``folder`` that are of one of the fifteen labels.

    Returns:
        The robot that all are of, and its motions.

    Raises:
        InputError: if there are none, or of several robots, or one is unsound.
    """
    motions = [motion for motion in open_motions(folder) if motion.label in LABELS]
    robots = sorted({motion.robot for motion in motions})
    if len(robots) != 1:
        found = f"of {', '.join(robots)}" if robots else "none"
        raise InputError(
            f"{str(folder)!r} must hold Motion files (*.npz) of one robot with labels "
            f"such as {LABELS[0]}; there are {found}."
        )
    return get_robot(robots[0]), by_split(motions)
