"""A folder of Motion files as training data."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.errors import InputError
from loco_drake.gaits import LABELS, GaitLabel
from loco_drake.generation.features import motion_features
from loco_drake.models.robots import get_robot
from loco_drake.motion import Motion, load_motion

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Clip:
    """One stretch of motion as features, or its mirror image.

    Attributes:
        robot: name of the robot.
        label: what it does.
        recording: the file that the motion was recorded in; clips of one recording
            can overlap and are never on both sides of a split.
        features: see :mod:`loco_drake.generation.features`, shape (T, SIZE).
    """

    robot: str
    label: GaitLabel
    recording: str
    features: Array

    def __len__(self) -> int:
        return len(self.features)


@dataclass(frozen=True)
class Library:
    """Clips to learn from and clips to test on, split by recording.

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


def load_library(folder: Path, held_out_fraction: float, seed: int) -> Library:
    """Reads every Motion file under ``folder``.

    Motions whose label is not one of the fifteen are left out.

    Args:
        folder: holds ``*.npz``, in subfolders too.
        held_out_fraction: least share of the seconds of each label to hold out, as
            far as the label has more than one recording; 0 holds out nothing.
        seed: which recordings are held out.

    Raises:
        InputError: if there are no motions with a label, or one is unsound.
    """
    folder = Path(folder)
    paths = sorted(folder.rglob("*.npz")) if folder.is_dir() else []
    motions = [(path, load_motion(path)) for path in paths]
    motions = [(path, motion) for path, motion in motions if motion.label in LABELS]
    if not motions:
        raise InputError(
            f"There are no Motion files (*.npz) with one of the labels "
            f"{', '.join(map(str, LABELS))} in {str(folder)!r}."
        )
    clips = [_clip(motion, str(path)) for path, motion in motions]
    mirrors = [_clip(motion.mirrored(), str(path)) for path, motion in motions]
    held = choose_held_out(clips, held_out_fraction, seed)
    return Library(
        train=tuple(c for c in (*clips, *mirrors) if c.recording not in held),
        held_out=tuple(c for c in clips if c.recording in held),
    )


def choose_held_out(clips: Sequence[Clip], fraction: float, seed: int) -> set[str]:
    """Returns recordings to hold out, so that each label has ``fraction`` of its time.

    No label loses its last recording, so that one with a single recording has none
    held out. Labels with few recordings choose first.
    """
    held: set[str] = set()
    if fraction <= 0:
        return held
    random = np.random.default_rng(seed)
    frames: dict[GaitLabel, dict[str, int]] = {}
    for clip in clips:
        of_label = frames.setdefault(clip.label, {})
        of_label[clip.recording] = of_label.get(clip.recording, 0) + len(clip)
    for label in sorted(frames, key=lambda label: (len(frames[label]), label)):
        of_label = frames[label]
        wanted = fraction * sum(of_label.values())
        for recording in random.permutation(sorted(of_label)):
            if sum(of_label.get(name, 0) for name in held) >= wanted:
                break
            if all(_remains(f, held | {str(recording)}) for f in frames.values()):
                held.add(str(recording))
    return held


def _remains(of_label: dict[str, int], held: set[str]) -> bool:
    """Whether a label keeps a recording to learn from."""
    return bool(set(of_label) - held)


def _clip(motion: Motion, path: str) -> Clip:
    robot = get_robot(motion.robot)
    return Clip(
        robot=motion.robot,
        label=motion.label,
        recording=motion.provenance.get("file", path),
        features=motion_features(robot, motion),
    )


class Sampler:
    """Draws clips so that every label is seen about equally often.

    A label is drawn with a probability that grows with the square root of its time:
    rare gaits are seen often enough to learn, and not so often that their few clips
    are learned by heart. Within a label a clip is drawn in proportion to its length.

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
