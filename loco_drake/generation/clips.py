"""Clips: stretches of motion as features, of which more exist than memory holds."""

import os
import tempfile
import weakref
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

import numpy as np

from loco_drake.common.arrays import Array, Integers
from loco_drake.generation.features import SIZE
from loco_drake.motion.gaits import LABELS, GaitLabel

# Frames that memory holds at once, at most: 46 MB of features, or 185 MB of curves
# through them. The shipped trainings have fewer.
HELD_FRAMES = 2**18


@dataclass(frozen=True, eq=False)
class Clip:
    """One stretch of motion as features, or its mirror image."""

    robot: str  # its name
    label: GaitLabel
    # Source and animal, or file of an unknown animal. Clips of one may overlap.
    recording: str
    features: Array  # see features.py, (T, SIZE)
    # 16 hexadecimal digits that stand for file, frames, mirroring and steering: the
    # same for all robots; empty if unknown.
    performance: str = ""
    grounded: bool = False  # whether it was made to obey physics

    def __len__(self) -> int:
        return len(self.features)


class Chosen(Sequence[Clip]):
    """Some of a sequence of clips, by their numbers in it."""

    def __init__(self, clips: Sequence[Clip], rows: Sequence[int] | Integers) -> None:
        self._clips = clips
        self._rows = np.asarray(rows, dtype=np.int64)

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, index: int) -> Clip: ...
    @overload
    def __getitem__(self, index: slice) -> "Chosen": ...
    def __getitem__(self, index: int | slice) -> "Clip | Chosen":
        if isinstance(index, slice):
            return Chosen(self._clips, self._rows[index])
        return self._clips[int(self._rows[index])]


class ClipFile(Sequence[Clip]):
    """Clips whose features are in a file without a name; memory holds an index.

    The file is gone when the process ends, for whatever reason.

    Args:
        folder: where the file is, which takes 176 bytes a frame; None for the system's
            folder for temporary files.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._end = 0  # frames in the file
        self._index = array("q")  # _COLUMNS of each clip
        self._robots = _Names()
        self._recordings = _Names()

    def append(self, clip: Clip) -> None:
        """Adds a clip with one of LABELS."""
        content = np.ascontiguousarray(clip.features, dtype=np.float64).tobytes()
        written = 0
        while written < len(content):
            written += self._file.write(content[written:])
        columns = (
            self._end,
            len(clip),
            self._robots.number(clip.robot),
            clip.label.index,
            self._recordings.number(clip.recording),
            int(clip.performance or "0", 16) - 2**63,
            bool(clip.performance) + 2 * clip.grounded,
        )
        self._index.extend(columns)
        self._end += len(clip)

    def __len__(self) -> int:
        return len(self._index) // _COLUMNS

    @overload
    def __getitem__(self, index: int) -> Clip: ...
    @overload
    def __getitem__(self, index: slice) -> Chosen: ...
    def __getitem__(self, index: int | slice) -> Clip | Chosen:
        if isinstance(index, slice):
            return Chosen(self, range(len(self))[index])
        at = range(0, len(self._index), _COLUMNS)[index]
        start, frames, robot, label, recording, performance, flags = self._index[
            at : at + _COLUMNS
        ]
        row = SIZE * np.dtype(np.float64).itemsize
        content = os.pread(self._file.fileno(), frames * row, start * row)
        return Clip(
            robot=self._robots.names[robot],
            label=LABELS[label],
            recording=self._recordings.names[recording],
            features=np.frombuffer(content).reshape(-1, SIZE),
            performance=f"{performance + 2**63:016x}" if flags & 1 else "",
            grounded=bool(flags & 2),
        )


_COLUMNS = 7  # first frame, frames, robot, label, recording, performance, flags


class _Names:
    """Names that are numbered in the order in which they come first."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self._numbers: dict[str, int] = {}

    def number(self, name: str) -> int:
        if name not in self._numbers:
            self._numbers[name] = len(self.names)
            self.names.append(name)
        return self._numbers[name]


def in_parts(clips: Sequence[Clip]) -> Iterator[list[Clip]]:
    """Yields the clips in parts of up to HELD_FRAMES frames, or of one longer clip."""
    part: list[Clip] = []
    held = 0
    for clip in clips:
        if part and held + len(clip) > HELD_FRAMES:
            yield part
            part, held = [], 0
        part.append(clip)
        held += len(clip)
    if part:
        yield part


def evenly(clips: Sequence[Clip], most: int) -> Sequence[Clip]:
    """Returns the clips if they are at most so many, else every so-manieth of them."""
    if len(clips) <= most:
        return clips
    return Chosen(clips, [i * len(clips) // most for i in range(most)])
