"""Windows of clips for training the tokenizer."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from torch import Tensor

from loco_drake.generation.features import CONTACTS, VELOCITY, YAW_RATE
from loco_drake.generation.training_motions import Clip, clip_probabilities

Array = NDArray[np.float64]

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
        self._curves = {
            clip: CubicSpline(np.arange(len(clip)), clip.features) for clip in clips
        }
        together: dict[str, list[Clip]] = defaultdict(list)
        for clip in clips:
            if clip.performance:
                together[clip.performance].append(clip)
        self._others = {
            clip: [c for c in together[clip.performance] if c.robot != clip.robot]
            for clip in clips
        }
        self._paired = any(self._others.values())

    def __call__(
        self, random: np.random.Generator, count: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns windows (N, WINDOW, SIZE), their robots (N,) and their labels (N,).

        Labels are indices into gaits.LABELS. N is ``count``; or twice as many if there
        are clips of several robots: the second half are the same windows of others.
        """
        drawn = random.choice(len(self._clips), size=count, p=self._probabilities)
        chosen = [self._clips[i] for i in drawn]
        cuts = [draw_cut(len(clip), random) for clip in chosen]
        if self._paired:
            others = [self._others[clip] or [clip] for clip in chosen]
            chosen += [among[random.integers(len(among))] for among in others]
            cuts += cuts
        frames = [
            cut_window(self._curves[clip], *cut)
            for clip, cut in zip(chosen, cuts, strict=True)
        ]
        return (
            torch.tensor(np.stack(frames), dtype=torch.float32),
            torch.tensor([self._robots.index(clip.robot) for clip in chosen]),
            torch.tensor([clip.label.index for clip in chosen]),
        )


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
