"""Is generated motion new, or learned by heart?

The distance of a trajectory to a recorded stretch is the least joint RMS, in rad, over
all shifts in time at which the two overlap by OVERLAP seconds at least; the mean
square is over the frames of the overlap and the twelve joints. The distance to a set
of stretches is that to the nearest one. A motion that was learned by heart is nearer
to what was learned from than a recording of another subject is.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from loco_drake.evaluation.samples import subject_of
from loco_drake.motion.motion import FPS, Motion

Array = NDArray[np.float64]

OVERLAP = 1.0  # s


def shifted_distances(trajectories: Array, stretch: Array) -> Array:
    """Returns the least joint RMS over all shifts, rad, shape (N,).

    Infinity if the stretch is too short to overlap.

    Args:
        trajectories: joint angles, shape (N, T, 12).
        stretch: joint angles, shape (L, 12).
    """
    frames, length = trajectories.shape[1], len(stretch)
    needed = round(OVERLAP * FPS)
    if min(frames, length) < needed:
        return np.full(len(trajectories), np.inf)
    # Sums over the frames i of the overlap, where frame i meets frame i + lag.
    lags = np.arange(needed - frames, length - needed + 1)
    first, last = np.maximum(0, -lags), np.minimum(frames, length - lags)
    size = next_fast_len(frames + length - 1, real=True)
    spectrum = np.conj(rfft(trajectories, size, axis=1)) * rfft(stretch, size, axis=0)
    product = irfft(spectrum.sum(axis=2), size, axis=1)[:, lags % size]

    def running(squares: Array) -> Array:
        total = np.cumsum(squares.sum(axis=-1), axis=-1)
        return np.concatenate((np.zeros_like(total[..., :1]), total), axis=-1)

    own, other = running(trajectories**2), running(stretch**2)
    squares = own[:, last] - own[:, first] + other[last + lags] - other[first + lags]
    squares = np.maximum(squares - 2 * product, 0.0)
    mean = squares / ((last - first) * trajectories.shape[2])
    least: Array = np.sqrt(mean.min(axis=1))
    return least


def nearest_distances(
    trajectories: Sequence[Motion],
    stretches: Sequence[Motion],
    *,
    other_subjects: bool = False,
) -> Array:
    """Returns each trajectory's distance to the nearest stretch of its label.

    Stretches count as they are and mirrored.

    Args:
        trajectories: all of one length.
        stretches: recorded motion.
        other_subjects: whether stretches of the trajectory's own subject are left out,
            as they must be where a trajectory was cut from one.

    Returns:
        rad, shape (N,); infinity where there is no stretch to compare with.
    """
    joints = np.stack([motion.joint_positions for motion in trajectories])
    labels = np.array([str(motion.label) for motion in trajectories])
    subjects = np.array([subject_of(motion) or "" for motion in trajectories])
    nearest = np.full(len(trajectories), np.inf)
    for stretch in stretches:
        allowed = labels == str(stretch.label)
        if other_subjects:
            allowed &= subjects != (subject_of(stretch) or "")
        if not allowed.any():
            continue
        for variant in (stretch, stretch.mirrored()):
            distances = shifted_distances(joints[allowed], variant.joint_positions)
            nearest[allowed] = np.minimum(nearest[allowed], distances)
    return nearest
