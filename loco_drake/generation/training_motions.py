"""Motion files as training data."""

from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from loco_drake import __version__
from loco_drake.common.errors import InputError
from loco_drake.common.progress import progress_bar
from loco_drake.common.weights import load_weights
from loco_drake.datasets.split import VALIDATION
from loco_drake.generation.clips import Chosen, Clip, ClipFile
from loco_drake.generation.features import motion_features
from loco_drake.generation.loop_settings import RUN_SETTINGS, LoopSettings
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS, GaitLabel
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_folder import open_motions

Array = NDArray[np.float64]

# What in the provenance tells performances apart.
_PERFORMANCE = ("file", "frames", "mirrored", "steered")


@dataclass(frozen=True)
class Library:
    """Clips for training and testing, split by recording."""

    train: Sequence[Clip]  # clips, then their mirror images
    held_out: Sequence[Clip]  # not mirrored, of recordings that are not in ``train``

    @cached_property
    def labels(self) -> tuple[GaitLabel, ...]:
        """The labels in ``train``, in the order of gaits.LABELS."""
        present = {clip.label for clip in self.train}
        return tuple(label for label in LABELS if label in present)

    @cached_property
    def grounded(self) -> bool:
        """Whether all motion in ``train`` was made to obey physics."""
        return all(clip.grounded for clip in self.train)

    @cached_property
    def robots(self) -> tuple[str, ...]:
        """The robots in ``train``, sorted by name."""
        return tuple(sorted({clip.robot for clip in self.train}))

    @cached_property
    def summary(self) -> str:
        """Size of the training data, which identifies the library."""
        frames = sum(len(clip) for clip in self.train)
        return f"{len(self.train)} clips of {frames} frames"


def load_library(*folders: Path, scratch: Path | None = None) -> Library:
    """Reads every motion with one of the fifteen labels in the folders.

    The split is the one that ``loco-drake retarget`` wrote into the files
    (:mod:`loco_drake.datasets.split`); motions without one are for training. Their
    features are in a file without a name in ``scratch``, see :class:`.ClipFile`.

    Raises:
        InputError: if there are no motions with a label to train on, one is unsound, or
            a recording is on both sides of the split.
    """
    where = ", ".join(repr(str(folder)) for folder in folders)
    opened = [open_motions(folder) for folder in folders]
    clips = ClipFile(scratch)
    train, mirrors, held_out = (array("q") for _ in range(3))
    subjects: tuple[set[str], set[str]] = (set(), set())
    with progress_bar() as progress:
        bar = progress.add_task("Reading", total=sum(map(len, opened)), note="")
        for motions in opened:
            for number, motion in enumerate(motions):
                progress.advance(bar)
                if motion.label not in LABELS:
                    continue
                validation = motion.provenance.get("split") == VALIDATION
                (held_out if validation else train).append(len(clips))
                try:
                    clip = motion_clip(motion, path := motions.path(number))
                except InputError as error:
                    raise InputError(f"{path}: {error}") from None
                clips.append(clip)
                subjects[validation].add(clip.recording)
                if not validation:
                    mirrors.append(len(clips))
                    clips.append(motion_clip(motion.mirrored(), path))
    if not len(clips):
        raise InputError(
            f"There are no Motion files (*.npz) with one of the labels "
            f"{', '.join(map(str, LABELS))} in {where}."
        )
    if not train:
        raise InputError(f"All motions in {where} are for validation.")
    if both := subjects[0] & subjects[1]:
        raise InputError(
            f"Motions of {min(both)} in {where} are for training and for "
            "validation: retarget all of them with the same --seed."
        )
    return Library(Chosen(clips, train + mirrors), Chosen(clips, held_out))


def motion_clip(motion: Motion, path: str = "") -> Clip:
    """Returns a motion as a clip; ``path`` identifies a recording without a name."""
    origin = motion.provenance
    performance = ""
    if "file" in origin and "frames" in origin:
        parts = (str(motion.label), *(origin.get(name, "") for name in _PERFORMANCE))
        text = " ".join(parts).encode()
        performance = blake2b(text, digest_size=8).hexdigest()
    return Clip(
        robot=motion.robot,
        label=motion.label,
        recording=recording_name(motion, path),
        features=motion_features(get_robot(motion.robot), motion),
        performance=performance,
        grounded=motion.grounded,
    )


def recording_name(motion: Motion, path: str = "") -> str:
    """Returns the source and the recording, or the animal if known, of a motion."""
    origin = motion.provenance
    recording = origin.get("animal") or origin.get("recording", path)
    return f"{motion.source}-{recording}"


def clip_probabilities(clips: Sequence[Clip]) -> Array:
    """Returns with which probability to draw each clip.

    That of a label grows with the square root of its duration: rare gaits are seen
    often enough to learn, but not so often that their few clips are memorized. Within a
    label the probability of a clip is proportional to its length.
    """
    time: Counter[tuple[str, GaitLabel]] = Counter()
    for clip in clips:
        time[clip.robot, clip.label] += len(clip)
    weights = [len(c) / np.sqrt(time[c.robot, c.label]) for c in clips]
    return np.array(weights) / np.sum(weights)


def training_record(
    library: Library, settings: LoopSettings, after: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Returns the record of a training, as JSON.

    ``recordings`` are the seconds that were learned from of each subject (a recording,
    or an animal with all of its own) and robot, mirror images not counted; ``held_out``
    are the subjects that were not; ``grounded`` is as in Library.

    Args:
        library: what was learned from.
        settings: how.
        after: the record of the training that went before, whose recordings count, too.
    """
    seconds: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    for clip in library.train[: len(library.train) // 2]:  # then come mirror images
        seconds[clip.recording][clip.robot] += len(clip) / FPS
    for name, of_robot in (after or {}).get("recordings", {}).items():
        seconds[name] = defaultdict(float, {**of_robot, **seconds[name]})
    return {
        "robots": list(library.robots),
        "grounded": library.grounded,
        "recordings": {
            name: {robot: round(s, 2) for robot, s in sorted(of_robot.items())}
            for name, of_robot in sorted(seconds.items())
        },
        "held_out": sorted({clip.recording for clip in library.held_out}),
        **{name: getattr(settings, name) for name in ("steps", *RUN_SETTINGS)},
        "loco_drake": __version__,
    }


def read_training_record(path: Path, kind: str) -> dict[str, Any] | None:
    """Returns the record in a weights file of a kind, None if there is none.

    Raises:
        InputError: if the file is missing, damaged, or of another kind.
    """
    _, config = load_weights(path, kind)
    info = config.get("info")
    record = info.get("training") if isinstance(info, dict) else None
    known = isinstance(record, dict) and isinstance(record.get("recordings"), dict)
    return record if known else None


def seen_in_training(
    record: dict[str, Any] | None, motions: Iterable[Motion]
) -> list[str] | None:
    """Returns the subjects of ``motions`` that weights were trained on, sorted.

    None if there is no record.
    """
    if record is None:
        return None
    return sorted({recording_name(m) for m in motions} & set(record["recordings"]))
