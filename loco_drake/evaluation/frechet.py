"""Frechet distance between two sets of feature vectors (Heusel et al. 2017, "FID").

Each set is taken for a normal distribution. Here the features are the embeddings of
the gait classifier: 32 channels, so that a few hundred trajectories tell a covariance.
The distance is biased upward where trajectories are few; it says something only beside
that of two sets of real ones.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EPSILON = 1e-6


def moments(features: Array, weights: Array) -> tuple[Array, Array]:
    """Returns weighted mean (C,) and covariance (C, C) of features (N, ..., C).

    Args:
        features: the vectors of a row, such as those of a trajectory and its mirror
            image, share the row's weight.
        weights: shape (N,).
    """
    sides = int(np.prod(features.shape[1:-1]))
    flat = features.reshape(-1, features.shape[-1])
    share = np.repeat(weights / weights.sum(), sides) / sides
    mean = share @ flat
    apart = flat - mean
    return mean, (apart * share[:, None]).T @ apart


def frechet_distance(a: tuple[Array, Array], b: tuple[Array, Array]) -> float:
    """Returns ``|m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2))``.

    EPSILON is added to the diagonals of both covariances, so that singular ones do no
    harm. The trace of the root is the sum of the roots of the eigenvalues of
    ``C_a^(1/2) C_b C_a^(1/2)``, which is symmetric.

    Args:
        a: mean (C,) and covariance (C, C).
        b: the same of the other.
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
