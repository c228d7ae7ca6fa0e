"""Windows of clips for training the tokenizer."""

from array import array
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from torch import Tensor

from loco_drake.common.errors import InputError
from loco_drake.generation.clips import HELD_FRAMES, Chosen, Clip
from loco_drake.generation.features import CONTACTS, VELOCITY, YAW_RATE
from loco_drake.generation.training_motions import clip_probabilities

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

WINDOW = 64  # frames
TEMPO = 1.15  # largest change of speed of a window
# Share of the windows without interpolation, which would smooth jitter.
EXACT = 0.5


class PairedWindows:
    """Draws windows of clips, each with the same window of another robot.

    A token must mean the same motion for all robots. The tokens of a window are
    therefore decoded for its own robot, and for another robot to which the same stretch
    of the same recording was retargeted, if there is one. Clips have WINDOW frames or
    more; the robots are those that the tokenizer knows, in its order.
    """

    def __init__(self, clips: Sequence[Clip], robots: Sequence[str]) -> None:
        self._clips = clips
        self._robots = robots
        self._probabilities = clip_probabilities(clips)
        self._curve = _Curves()
        # Clips in the order of their performances, the same ones beside each other.
        count = len(clips)
        self._known = np.zeros(count, dtype=bool)
        self._performance = np.zeros(count, dtype=np.uint64)
        self._robot = np.zeros(count, dtype=np.int16)
        for row, clip in enumerate(clips):
            self._robot[row] = robots.index(clip.robot)
            if clip.performance:
                self._known[row] = True
                self._performance[row] = int(clip.performance, 16)
        rows = np.flatnonzero(self._known)
        self._rows = rows[np.argsort(self._performance[rows], kind="stable")]
        self._sorted = self._performance[self._rows]
        robot = self._robot[self._rows]
        same = self._sorted[1:] == self._sorted[:-1]
        self._paired = bool((same & (robot[1:] != robot[:-1])).any())

    def __call__(
        self, random: np.random.Generator, count: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns windows (N, WINDOW, SIZE), their robots (N,) and their labels (N,).

        Labels are indices into gaits.LABELS. N is ``count``; or twice as many if there
        are clips of several robots: the second half are the same windows of others.
        """
        drawn = random.choice(len(self._clips), size=count, p=self._probabilities)
        chosen = [(int(row), self._clips[row]) for row in drawn]
        cuts = [draw_cut(len(clip), random) for _, clip in chosen]
        if self._paired:
            others = [self._others(row) for row, _ in chosen]
            rows = [int(among[random.integers(len(among))]) for among in others]
            chosen += [(row, self._clips[row]) for row in rows]
            cuts += cuts
        frames = [
            cut_window(self._curve(row, clip), *cut)
            for (row, clip), cut in zip(chosen, cuts, strict=True)
        ]
        return (
            torch.tensor(np.stack(frames), dtype=torch.float32),
            torch.tensor([self._robots.index(clip.robot) for _, clip in chosen]),
            torch.tensor([clip.label.index for _, clip in chosen]),
        )

    def _others(self, row: int) -> Integers:
        """Returns the clips of other robots that are the same as one, or this one."""
        first, end = (
            np.searchsorted(self._sorted, self._performance[row], side=side)
            for side in ("left", "right")
        )
        same = self._rows[first:end] if self._known[row] else self._rows[:0]
        others = same[self._robot[same] != self._robot[row]]
        return others if len(others) else np.array([row])


class _Curves:
    """Curves through the clips, of which those that were used last are kept."""

    def __init__(self) -> None:
        self._kept: OrderedDict[int, CubicSpline] = OrderedDict()
        self._frames = 0

    def __call__(self, row: int, clip: Clip) -> CubicSpline:
        """Returns the curve of clip number ``row``."""
        if row in self._kept:
            self._kept.move_to_end(row)
            return self._kept[row]
        curve = CubicSpline(np.arange(len(clip)), clip.features)
        self._kept[row] = curve
        self._frames += len(clip)
        while self._frames > HELD_FRAMES and len(self._kept) > 1:
            _, oldest = self._kept.popitem(last=False)
            self._frames -= len(oldest.x)
        return curve


def long_enough(clips: Sequence[Clip]) -> Sequence[Clip]:
    """Returns the clips that hold a window.

    Raises:
        InputError: if there are none.
    """
    rows = array("q", (i for i, clip in enumerate(clips) if len(clip) >= WINDOW))
    if not rows:
        raise InputError(f"No motion to train on is at least {WINDOW} frames long.")
    return Chosen(clips, rows)


def draw_cut(frames: int, random: np.random.Generator) -> tuple[float, float]:
    """Returns where in a clip to begin a window, and the tempo to play it at."""
    last = frames - 1
    if random.random() < EXACT:
        return float(random.integers(last - WINDOW + 2)), 1.0
    fastest = min(TEMPO, last / (WINDOW - 1))
    tempo = min(TEMPO ** random.uniform(-1, 1), fastest)
    return random.uniform(0, last - tempo * (WINDOW - 1)), tempo


def cut_window(curve: CubicSpline, start: float, tempo: float) -> Array:
    """Returns WINDOW frames from frame ``start`` on, played ``tempo`` times as fast.

    The curve is of a clip's features. Feet in stance remain still at any tempo.
    """
    window: Array = curve(start + tempo * np.arange(WINDOW))
    window[:, VELOCITY] *= tempo
    window[:, YAW_RATE] *= tempo
    window[:, CONTACTS] = window[:, CONTACTS] > 0.5
    return window
