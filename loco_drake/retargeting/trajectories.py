"""Short trajectories of equal length, cut from retargeted stretches.

Experiments compare them, as in the paper (Section IV): 2 s each, a few per label,
without overlap, from the middle of the stretches, in the set of their recording. Models
train on the whole stretches instead.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from loco_drake.common.errors import InputError
from loco_drake.datasets.split import TRAIN, VALIDATION
from loco_drake.motion.gaits import LABELS, GaitLabel
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_file import load_motion, save_motion

SECONDS = 2.0

# Of the trajectories of a label, as many for validation as in the paper's Table 1.
VALIDATION_SHARE = 0.4


def trajectories(motion: Motion, seconds: float = SECONDS) -> list[Motion]:
    """Cuts a motion into as many trajectories of ``seconds`` as it holds.

    They are consecutive and centred; the remainder is left over at both ends.

    Raises:
        InputError: if ``seconds`` is less than two frames.
    """
    size = _frames(seconds, motion.fps)
    count = len(motion) // size
    return [cut(motion, start, size) for start in _packed(0, len(motion), size, count)]


def cut(motion: Motion, start: int, size: int) -> Motion:
    """Returns ``size`` frames of a motion from ``start`` on.

    The provenance's "frames", which are the recording's, are those of the cut.
    """
    provenance = dict(motion.provenance)
    if {"frames", "recording_fps"} <= set(provenance):
        first = int(provenance["frames"].split("-")[0])
        time_scale = float(provenance.get("time_scale", 1.0))
        rate = float(provenance["recording_fps"]) / (motion.fps * time_scale)
        ends = (first + start * rate, first + (start + size - 1) * rate + 1)
        provenance["frames"] = f"{int(ends[0])}-{int(np.ceil(ends[1]))}"
    return replace(motion.slice(start, start + size), provenance=provenance)


@dataclass(frozen=True)
class Stretch:
    """A retargeted stretch of a recording, as needed for cutting trajectories."""

    path: Path  # of its Motion file
    label: GaitLabel  # what it holds
    recording: str  # which no two trajectories may share a moment of
    subject: str  # the animal, or else the recording
    side: str  # of the split
    start: float  # when it starts in the recording, s
    frames: int  # of its motion
    rate: float = FPS  # frames of its motion for each second of the recording


@dataclass(frozen=True)
class Window:
    """Frames ``start`` to ``start + size`` of a stretch."""

    stretch: Stretch
    start: int
    size: int

    @property
    def interval(self) -> tuple[float, float]:
        """First and last moment within the recording, s."""
        first = self.stretch.start + self.start / self.stretch.rate
        return first, first + self.size / self.stretch.rate


def choose_windows(
    stretches: Iterable[Stretch], count: int, seed: int = 0, seconds: float = SECONDS
) -> list[Window]:
    """Returns up to ``count`` windows for each of the fifteen labels.

    No two overlap in a recording. Every stretch first offers the window in its middle;
    if these are fewer than ``count``, stretches offer two, three, ... side by side. Two
    fifths are from the validation set if available, the others from the training set,
    with subjects in turn; ``seed`` decides which come first. If one set has too few,
    the other fills up. Windows last ``seconds``.
    """
    size = _frames(seconds, FPS)
    by_label: dict[GaitLabel, list[Stretch]] = {}
    for stretch in stretches:
        if stretch.label in LABELS:
            by_label.setdefault(stretch.label, []).append(stretch)
    random = np.random.default_rng(seed)
    chosen: list[Window] = []
    # Labels with little to choose from choose first.
    for label in sorted(
        by_label, key=lambda k: (sum(s.frames for s in by_label[k]), k)
    ):
        own = by_label[label]
        best: list[Window] = []
        for most in range(1, max(s.frames for s in own) // size + 1):
            picked = _pick(_offers(own, size, most, chosen), count, random)
            best = max(best, picked, key=lambda p: (len(p), _validation(p)))
            if len(best) == count and _validation(best) >= _quota(count):
                break
        chosen += best
    return chosen


def write_trajectories(windows: Sequence[Window], folder: Path) -> list[Path]:
    """Writes ``folder/LABEL-NUMBER.npz`` for each window and returns the paths.

    Removes surplus files of the same labels from earlier runs, which may overlap the
    new ones or be in the other set.
    """
    folder = Path(folder)
    paths: list[Path] = []
    for label in dict.fromkeys(window.stretch.label for window in windows):
        own = [window for window in windows if window.stretch.label == label]
        for number, window in enumerate(own):
            motion = cut(load_motion(window.stretch.path), window.start, window.size)
            paths.append(folder / f"{label}-{number}.npz")
            save_motion(motion, paths[-1])
        for path in folder.glob(f"{label}-*.npz"):
            if path.stem.removeprefix(f"{label}-").isdigit() and path not in paths:
                path.unlink()
    return paths


def _frames(seconds: float, fps: float) -> int:
    if not 2 <= seconds * fps < float("inf"):
        raise InputError(f"A trajectory of {seconds:g} s has fewer than two frames.")
    return round(seconds * fps)


def _packed(start: int, end: int, size: int, count: int) -> list[int]:
    """Returns where ``count`` windows begin, side by side in the middle."""
    first = start + (end - start - count * size) // 2
    return [first + i * size for i in range(count)]


def _offers(
    stretches: Sequence[Stretch], size: int, most: int, taken: Sequence[Window]
) -> list[Window]:
    """Returns windows of ``size`` frames that overlap neither each other nor ``taken``.

    A stretch offers up to ``most``, side by side in the largest part that is free.
    """
    offers: list[Window] = []
    for stretch in sorted(stretches, key=lambda s: (-s.frames, s.path)):
        busy = [
            _frames_of(window.interval, stretch)
            for window in (*taken, *offers)
            if window.stretch.recording == stretch.recording
        ]
        gaps, free = [], 0
        for first, last in [*sorted(busy), (stretch.frames, stretch.frames)]:
            gaps.append((min(first, stretch.frames) - free, free))
            free = max(free, last)
        length, start = max(gaps)
        fitting = min(most, length // size)
        if fitting > 0:
            begins = _packed(start, start + length, size, fitting)
            offers += [Window(stretch, begin, size) for begin in begins]
    return offers


def _frames_of(interval: tuple[float, float], stretch: Stretch) -> tuple[int, int]:
    """Returns the frames of a stretch that a time of its recording touches."""
    first, last = ((t - stretch.start) * stretch.rate for t in interval)
    return int(np.floor(first + 1e-6)), int(np.ceil(last - 1e-6))


def _quota(count: int) -> int:
    return round(VALIDATION_SHARE * count)


def _validation(windows: Sequence[Window]) -> int:
    return sum(window.stretch.side == VALIDATION for window in windows)


def _pick(
    offers: Sequence[Window], count: int, random: np.random.Generator
) -> list[Window]:
    """Returns up to ``count`` of the windows, from both sides, subjects in turn."""
    sides = {
        side: _in_turn([w for w in offers if w.stretch.side == side], random)
        for side in (TRAIN, VALIDATION)
    }
    validation = min(_quota(count), len(sides[VALIDATION]))
    train = min(count - validation, len(sides[TRAIN]))
    return sides[TRAIN][:train] + sides[VALIDATION][: count - train]


def _in_turn(windows: Sequence[Window], random: np.random.Generator) -> list[Window]:
    """Returns the windows so that subjects, recordings and stretches take turns."""
    left = [windows[i] for i in random.permutation(len(windows))]
    used: Counter[object] = Counter()
    turns = []
    while left:
        window = min(left, key=lambda w: [used[key] for key in _keys(w.stretch)])
        left.remove(window)
        used.update(_keys(window.stretch))
        turns.append(window)
    return turns


def _keys(stretch: Stretch) -> list[object]:
    return [("subject", stretch.subject), ("file", stretch.recording), stretch.path]
