"""Zero-phase smoothing of trajectories, free of transients at their ends."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags_array, eye_array
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]

ORDER = 3


def difference_matrix(frames: int) -> csc_matrix:
    """Returns D, shape (frames - 3, frames), of third differences."""
    rows = frames - ORDER
    if rows <= 0:
        return csc_matrix((0, frames))
    stencil = (-1.0, 3.0, -3.0, 1.0)
    return csc_matrix(
        diags_array(stencil, offsets=range(ORDER + 1), shape=(rows, frames))
    )


def penalty(cutoff: float, fps: float) -> float:
    """Returns the weight of squared third differences that halves ``cutoff`` Hz.

    min |x - y|^2 + w |D x|^2 is the low-pass filter 1 / (1 + w (2 sin(pi f / fps))^6):
    a Butterworth's shape, without its phase. Above half the rate nothing is smoothed.
    """
    if cutoff >= fps / 2:
        return 0.0
    return float((2 * np.sin(np.pi * cutoff / fps)) ** (-2 * ORDER))


def smooth(values: Array, cutoff: float, fps: float) -> Array:
    """Returns ``values`` (T, ...) after a zero-phase low-pass along the first axis.

    Whittaker's smoother: the trajectory nearest to ``values`` whose third differences
    are small, see :func:`penalty`. Quadratics pass unchanged, also at the ends.
    """
    frames = len(values)
    D = difference_matrix(frames)
    system = eye_array(frames, format="csc") + penalty(cutoff, fps) * (D.T @ D)
    smoothed: Array = splu(csc_matrix(system)).solve(values.reshape(frames, -1))
    return smoothed.reshape(values.shape)
