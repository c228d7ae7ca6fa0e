"""Long motions assembled from short clips, with transitions where the clips agree.

Recorded gallops last two seconds, so a generator trained on them alone never learns to
continue. Motions of any length are walks in a motion graph (Kovar, Gleicher, Pighin
2002): they leave and enter clips at frames with similar poses and speeds, and blend
over a few frames.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import convolve

from loco_drake.common.errors import InputError
from loco_drake.generation.clips import Chosen, Clip
from loco_drake.generation.features import CONTACTS, JOINTS
from loco_drake.motion.motion import FPS

Array = NDArray[np.float64]

STRIDE = 25  # frames over which pace is averaged
BLEND = 8  # frames in which one clip goes over into another
SHORTEST_STAY = 20  # frames in a clip between two blends
SHORTEST = 2 * BLEND + SHORTEST_STAY  # frames; shorter clips cannot be used
# Frames among which a transition is sought, at most; no recorded gait has more.
POOL = 2**16
EXITS = 10  # frames before and after the wished-for one at which a clip may be left
GREED = 0.1  # spread of the costs among which a transition is drawn
TO_THE_END = 0.7  # probability of staying in a clip to its end
PACE_WEIGHT = 3.0  # of speed and turning over a stride, in standard deviations
EVENNESS = 2.0  # cost of entering where it was played as often as on average


class Stitcher:
    """Assembles long motions from clips of one robot and one label.

    It counts how often each frame was used and prefers others. Otherwise clips that
    slow down would lead to ever slower ones, where all motion would end. Clips of up to
    SHORTEST frames are left out.

    Raises:
        InputError: if all clips are too short.
    """

    def __init__(self, clips: Sequence[Clip]) -> None:
        self._clips = [c.features for c in clips if len(c) > SHORTEST]
        if not self._clips:
            raise InputError(
                f"A generator needs clips of more than {SHORTEST} "
                f"frames of each label; those of {clips[0].label} are shorter."
            )
        # A frame is described by pose and speeds, in standard deviations.
        described = np.concatenate([_described(clip) for clip in self._clips])
        self._frames = described / np.maximum(described.std(axis=0), 1e-3)
        self._frames[:, -3:] *= PACE_WEIGHT
        lengths = [len(c) for c in self._clips]
        self._first = np.cumsum([0, *lengths[:-1]])  # row in _frames of a clip's first
        self._clip_of = np.repeat(np.arange(len(lengths)), lengths)
        self._frame_of = np.concatenate([np.arange(n) for n in lengths])
        left = np.repeat(lengths, lengths) - self._frame_of
        self._enterable = np.flatnonzero(left > SHORTEST)
        self._played = np.zeros(len(described))  # how often each frame was, so far

    def __call__(self, frames: int, random: np.random.Generator) -> Array:
        """Returns the features of a motion of ``frames`` frames, shape (frames, SIZE).

        It starts anywhere in a clip.
        """
        row = int(random.choice(self._enterable))
        clip, frame = int(self._clip_of[row]), int(self._frame_of[row])
        parts: list[Array] = []
        made = 0
        while made < frames:
            leave, row = self._transition(clip, frame, random)
            next_clip, enter = int(self._clip_of[row]), int(self._frame_of[row])
            weight = (np.arange(1, BLEND + 1) / (BLEND + 1))[:, None]
            a = self._clips[clip][leave : leave + BLEND]
            b = self._clips[next_clip][enter : enter + BLEND]
            blend = (1 - weight) * a + weight * b
            blend[:, CONTACTS] = blend[:, CONTACTS] > 0.5
            parts += [self._clips[clip][frame:leave], blend]
            made += leave - frame + BLEND
            start = self._first[clip]
            self._played[start + frame : start + leave] += 1
            clip, frame = next_clip, enter + BLEND
        return np.concatenate(parts)[:frames]

    def _transition(
        self, clip: int, frame: int, random: np.random.Generator
    ) -> tuple[int, int]:
        """Returns where to leave a clip that is at ``frame``, and the row to enter."""
        earliest, latest = frame + SHORTEST_STAY, len(self._clips[clip]) - BLEND
        wished = latest
        if random.random() > TO_THE_END:
            wished = int(random.integers(earliest, latest + 1))
        exits = np.arange(
            max(wished - EXITS, earliest), min(wished + EXITS, latest) + 1
        )
        rows = self._first[clip] + exits
        # (exits, enterable): mean squared difference.
        a, b = self._frames[rows], self._frames[self._enterable]
        cost = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2 * a @ b.T
        cost = np.maximum(cost, 0.0) / a.shape[1]
        total = np.concatenate(([0.0], np.cumsum(self._played)))
        ahead = total[self._enterable + SHORTEST_STAY] - total[self._enterable]
        # Add one to the mean, so that a single use counts little.
        cost += EVENNESS * ahead / (SHORTEST_STAY * (1 + self._played.mean()))
        # Exclude transitions to the current place.
        same = self._clip_of[self._enterable] == clip
        near = np.abs(self._frame_of[self._enterable] - exits[:, None]) < SHORTEST_STAY
        cost[same & near] = np.inf
        if not np.isfinite(cost).any():
            cost = np.zeros_like(cost)
        odds = np.exp((cost.min() - cost) / GREED).ravel()
        choice = random.choice(len(odds), p=odds / odds.sum())
        exit_index, target = divmod(int(choice), len(self._enterable))
        return int(exits[exit_index]), int(self._enterable[target])


def pools(clips: Sequence[Clip], random: np.random.Generator) -> list[Sequence[Clip]]:
    """Returns clips of one robot and label in pools of about POOL frames or less.

    All in one if they are few, else those that can be used, shuffled.
    """
    lengths = np.fromiter((len(clip) for clip in clips), np.int64, len(clips))
    if lengths.sum() <= POOL or lengths.max() <= SHORTEST:
        return [clips]
    rows = random.permutation(np.flatnonzero(lengths > SHORTEST))
    ends = np.cumsum(lengths[rows])
    cuts = np.flatnonzero(np.diff((ends - 1) // POOL)) + 1
    return [Chosen(clips, part) for part in np.split(rows, cuts)]


def _described(clip: Array) -> Array:
    """Returns pose, joint speeds, and mean base velocity over a stride, (T, 33)."""
    pose, pace = clip[:, : CONTACTS.start], clip[:, :3]
    speeds = np.gradient(clip[:, JOINTS], 1 / FPS, axis=0)
    kernel = np.ones((STRIDE, 1))
    known = convolve(np.ones_like(pace), kernel, mode="same", method="direct")
    mean = convolve(pace, kernel, mode="same", method="direct") / known
    return np.concatenate((pose, speeds, mean), axis=1)
