"""Motion files as training data."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from loco_drake import __version__
from loco_drake.common.errors import InputError
from loco_drake.common.weights import load_weights
from loco_drake.datasets.split import VALIDATION
from loco_drake.generation.features import motion_features
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS, GaitLabel
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_file import load_motion

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Clip:
    """One stretch of motion as features, or its mirror image.

    Attributes:
        robot: name of the robot.
        label: gait label.
        recording: source and animal, or recording if the animal is unknown; clips of
            one can overlap and are always in the same set.
        features: see :mod:`loco_drake.generation.features`, shape (T, SIZE).
        performance: file, frames and mirroring: equal for all robots to which this
            stretch was retargeted; empty if unknown.
    """

    robot: str
    label: GaitLabel
    recording: str
    features: Array
    performance: str = ""

    def __len__(self) -> int:
        return len(self.features)


@dataclass(frozen=True)
class Library:
    """Clips for training and testing, split by recording.

    Attributes:
        train: clips and their mirror images.
        held_out: clips, not mirrored, of recordings that ``train`` has nothing of.
    """

    train: tuple[Clip, ...]
    held_out: tuple[Clip, ...]

    @property
    def labels(self) -> tuple[GaitLabel, ...]:
        """The labels in ``train``, in the order of gaits.LABELS."""
        present = {clip.label for clip in self.train}
        return tuple(label for label in LABELS if label in present)

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots in ``train``, sorted by name."""
        return tuple(sorted({clip.robot for clip in self.train}))

    @property
    def summary(self) -> str:
        """Size of the training data, which identifies the library."""
        frames = sum(len(clip) for clip in self.train)
        return f"{len(self.train)} clips of {frames} frames"


def load_library(*folders: Path) -> Library:
    """Reads every Motion file under the folders.

    The split is the one that ``loco-drake retarget`` wrote into the files
    (:mod:`loco_drake.datasets.split`); motions without one are for training. Those
    whose label is not one of the fifteen are left out.

    Args:
        folders: hold ``*.npz``, in subfolders too; such as one for each robot.

    Raises:
        InputError: if there are no motions with a label to train on, one is unsound, or
            a recording is on both sides of the split.
    """
    where = ", ".join(repr(str(folder)) for folder in folders)
    for folder in folders:
        if not Path(folder).is_dir():
            raise InputError(f"There is no folder of Motion files {str(folder)!r}.")
    paths = [path for folder in folders for path in sorted(folder.rglob("*.npz"))]
    motions = [(path, load_motion(path)) for path in paths]
    motions = [(path, motion) for path, motion in motions if motion.label in LABELS]
    if not motions:
        raise InputError(
            f"There are no Motion files (*.npz) with one of the labels "
            f"{', '.join(map(str, LABELS))} in {where}."
        )
    train, mirrors, held_out = [], [], []
    for path, motion in motions:
        try:
            clip = motion_clip(motion, str(path))
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        if motion.provenance.get("split") == VALIDATION:
            held_out.append(clip)
        else:
            train.append(clip)
            mirrors.append(motion_clip(motion.mirrored(), str(path)))
    if not train:
        raise InputError(f"All motions in {where} are for validation.")
    both = {clip.recording for clip in train} & {clip.recording for clip in held_out}
    if both:
        raise InputError(
            f"Motions of {min(both)} in {where} are for training and for "
            "validation: retarget all of them with the same --seed."
        )
    return Library(train=(*train, *mirrors), held_out=tuple(held_out))


def motion_clip(motion: Motion, path: str = "") -> Clip:
    """Returns a motion as a clip; ``path`` identifies a recording without a name."""
    robot = get_robot(motion.robot)
    return Clip(
        robot=motion.robot,
        label=motion.label,
        recording=recording_name(motion, path),
        features=motion_features(robot, motion),
        performance=_performance(motion),
    )


def recording_name(motion: Motion, path: str = "") -> str:
    """Returns the source and the recording, or the animal if known, of a motion."""
    origin = motion.provenance
    recording = origin.get("animal") or origin.get("recording", path)
    return f"{motion.source}-{recording}"


def _performance(motion: Motion) -> str:
    origin = motion.provenance
    if "file" not in origin or "frames" not in origin:
        return ""
    parts = (origin["file"], origin["frames"], origin.get("mirrored", ""))
    return " ".join((str(motion.label), *parts))


class Sampler:
    """Samples clips so that every label is seen about equally often.

    The probability of a label grows with the square root of its duration: rare gaits
    are seen often enough to learn, but not so often that their few clips are memorized.
    Within a label the probability of a clip is proportional to its length.

    Args:
        clips: to draw from.
    """

    def __init__(self, clips: Sequence[Clip]) -> None:
        self.clips = clips
        time: dict[tuple[str, GaitLabel], int] = {}
        for clip in clips:
            key = (clip.robot, clip.label)
            time[key] = time.get(key, 0) + len(clip)
        weights = [len(c) / np.sqrt(time[c.robot, c.label]) for c in clips]
        self.probabilities = np.array(weights) / np.sum(weights)

    def __call__(self, random: np.random.Generator, count: int) -> NDArray[np.int64]:
        """Returns the indices of ``count`` clips."""
        return random.choice(len(self.clips), size=count, p=self.probabilities)


def training_record(library: Library, settings: LoopSettings) -> dict[str, Any]:
    """Returns the record of a training, as JSON.

    Returns:
        ``robots``; ``recordings``, the seconds of motion learned from of each subject
        (a recording, or an animal with all of its own) and robot, mirror images not
        counted; ``held_out``, the subjects that were not; and the settings.
    """
    seconds: dict[str, dict[str, float]] = {}
    for clip in library.train[: len(library.train) // 2]:  # then come mirror images
        of_robot = seconds.setdefault(clip.recording, {})
        of_robot[clip.robot] = of_robot.get(clip.robot, 0.0) + len(clip) / FPS
    return {
        "robots": list(library.robots),
        "recordings": {
            name: {robot: round(s, 2) for robot, s in sorted(of_robot.items())}
            for name, of_robot in sorted(seconds.items())
        },
        "held_out": sorted({clip.recording for clip in library.held_out}),
        "steps": settings.steps,
        "learning_rate": settings.learning_rate,
        "weight_decay": settings.weight_decay,
        "seed": settings.seed,
        "loco_drake": __version__,
    }


def read_training_record(path: Path, kind: str) -> dict[str, Any] | None:
    """Returns the record in a weights file, None if there is none.

    Args:
        path: of the weights.
        kind: "tokenizer" or "generator".

    Raises:
        InputError: if the file is missing, damaged, or of something else.
    """
    _, config = load_weights(path, kind)
    info = config.get("info")
    record = info.get("training") if isinstance(info, dict) else None
    known = isinstance(record, dict) and isinstance(record.get("recordings"), dict)
    return record if known else None


def seen_in_training(
    record: dict[str, Any] | None, motions: Iterable[Motion]
) -> list[str] | None:
    """Returns which recordings of ``motions`` the weights were trained on.

    Args:
        record: from :func:`read_training_record`.
        motions: retargeted recordings.

    Returns:
        Sorted names of subjects; None if it was not recorded.
    """
    if record is None:
        return None
    return sorted({recording_name(m) for m in motions} & set(record["recordings"]))
