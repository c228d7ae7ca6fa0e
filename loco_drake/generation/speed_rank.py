"""Speed rank: the rank of a speed among the recorded speeds of a gait.

A generator conditioned on the gait alone wanders through all recorded speeds.
Conditioned on the rank as well, it keeps its speed. A rank applies to any gait: 0 is
the slowest recorded speed, 1 the fastest.
"""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from loco_drake.common.determinism import uniforms
from loco_drake.generation.features import VELOCITY
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import FPS

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

BINS = 16
SMOOTHING = 2.0  # s over which speed is averaged
_DICE = 2**62  # index of the random numbers for the rank; chunks count from 0


def token_speeds(features: Array, frames_per_token: int) -> Array:
    """Returns the speed along the heading around each token, stand heights/s, (T / f,).

    Features are (T, SIZE).
    """
    frames = len(features) // frames_per_token * frames_per_token
    forward = features[:frames, VELOCITY.start]
    smooth = uniform_filter1d(forward, round(SMOOTHING * FPS), mode="nearest")
    return np.asarray(smooth.reshape(-1, frames_per_token).mean(axis=1))


def speed_edges(speeds: Iterable[tuple[int, Array]]) -> Array:
    """Returns the speeds between the bins of each label, (labels, BINS - 1).

    Takes label and :func:`token_speeds` of all clips. A bin holds as much motion of its
    label as any other.
    """
    by_label: dict[int, list[Array]] = defaultdict(list)
    for label, of_clip in speeds:
        by_label[label].append(of_clip)
    edges = np.zeros((len(LABELS), BINS - 1))
    for label, clips in by_label.items():
        shares = np.arange(1, BINS) / BINS
        edges[label] = np.quantile(np.concatenate(clips), shares)
    return edges


def rank_bin(rank: Array) -> Integers:
    """Returns the bin of ranks in [0, 1]."""
    return np.minimum(np.asarray(rank) * BINS, BINS - 1).astype(np.int64)


def drawn_rank(seeds: Integers) -> Array:
    """Returns the rank in [0, 1) that goes with each seed, (B,)."""
    return np.array([uniforms(int(seed), _DICE, (1,))[0] for seed in seeds])
