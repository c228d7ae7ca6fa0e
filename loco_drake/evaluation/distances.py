"""Distances between generated and recorded motion, of sets and of trajectories.

Frechet distance (Heusel et al. 2017, "FID")
    Between two sets of feature vectors, each approximated by a normal distribution.
    The features are embeddings of the gait classifier, whose 32 channels allow a
    covariance to be estimated from a few hundred trajectories. The distance is biased
    upward for few trajectories, and is meaningful only beside that of two sets of
    recordings.
Distance to the nearest recording
    Distinguishes novel from memorized motion. The distance of a trajectory to a
    recorded stretch is the smallest RMS joint difference, in rad, over all time shifts
    with an overlap of at least OVERLAP seconds. The mean is over the frames of the
    overlap and the twelve joints. Memorized motion is nearer to the training data than
    recordings of other subjects are.
"""

from collections.abc import Sequence

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from loco_drake.common.arrays import Array
from loco_drake.evaluation.samples import subject_of
from loco_drake.motion.motion import FPS, Motion

EPSILON = 1e-6
OVERLAP = 1.0  # s


def moments(features: Array, weights: Array) -> tuple[Array, Array]:
    """Returns weighted mean (C,) and covariance (C, C) of features (N, ..., C).

    Vectors of one row, such as those of a trajectory and its mirror image, share its
    weight; weights have the shape (N,).
    """
    sides = int(np.prod(features.shape[1:-1]))
    flat = features.reshape(-1, features.shape[-1])
    share = np.repeat(weights / weights.sum(), sides) / sides
    mean = share @ flat
    apart = flat - mean
    return mean, (apart * share[:, None]).T @ apart


def frechet_distance(a: tuple[Array, Array], b: tuple[Array, Array]) -> float:
    """Returns ``|m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2))`` of two moments.

    EPSILON is added to the diagonals of both covariances, so that singular ones do no
    harm. The trace of the root is the sum of the roots of the eigenvalues of
    ``C_a^(1/2) C_b C_a^(1/2)``, which is symmetric.
    """
    (mean_a, cov_a), (mean_b, cov_b) = a, b
    floor = EPSILON * np.eye(len(mean_a))
    cov_a, cov_b = cov_a + floor, cov_b + floor
    values, vectors = np.linalg.eigh(cov_a)
    root_a = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    product = np.linalg.eigvalsh(root_a @ cov_b @ root_a)
    overlap = float(np.sqrt(np.maximum(product, 0.0)).sum())
    shift = float(((mean_a - mean_b) ** 2).sum())
    spread = float(np.trace(cov_a) + np.trace(cov_b))
    return max(0.0, shift + spread - 2 * overlap)


def shifted_distances(trajectories: Array, stretch: Array) -> Array:
    """Returns the least joint RMS over all shifts, rad, shape (N,).

    Trajectories (N, T, 12) and stretch (L, 12) are joint angles in rad. The distance is
    infinite if the stretch is too short to overlap.
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

    All trajectories have one length. Stretches count as they are and mirrored; with
    ``other_subjects`` those of a trajectory's own subject are left out, as they must be
    if it was cut from one. Distances are in rad, shape (N,), and infinite without a
    stretch to compare with.
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
