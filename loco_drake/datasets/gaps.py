"""Markers that the cameras lost for a while."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from loco_drake.common.errors import InputError
from loco_drake.common.runs import intervals
from loco_drake.datasets.normalize import check_range

Array = NDArray[np.float64]


def mend_gaps(points: Array, longest: int) -> tuple[Array, int]:
    """Returns points whose short gaps are bridged by cubic splines.

    Args:
        points: shape (T, N, 3), NaN where a marker was not seen.
        longest: frames that a gap may have to be bridged; none at an end is.

    Returns:
        The points, and how many frames were bridged.
    """
    points = points.copy()
    bridged = np.zeros(len(points), dtype=bool)
    frames = np.arange(len(points))
    for marker in range(points.shape[1]):
        seen = _all_seen(points[:, marker])
        if seen.all() or seen.sum() < 4:
            continue
        spline = CubicSpline(frames[seen], points[seen, marker])
        for start, end in intervals(~seen):
            if end - start <= longest and start > 0 and end < len(points):
                points[start:end, marker] = spline(frames[start:end])
                bridged[start:end] = True
    return points, int(bridged.sum())


def usable_stretch(
    points: Array, start: int | None, end: int | None, name: str
) -> tuple[slice, int, int]:
    """Returns where the points have no gaps, and the stretch of that to be read.

    Args:
        points: shape (T, N, 3), NaN where a marker was not seen.
        start: first frame asked for, None for any.
        end: frame after the last one asked for, None for any.
        name: of the file, for messages.

    Returns:
        All frames around the stretch without a gap, its first frame and the one after
        its last. Without ``start`` and ``end`` it is the longest there is.

    Raises:
        InputError: if the stretch does not lie within the file, or has a gap.
    """
    whole = _all_seen(points)
    runs = list(intervals(whole))
    if not runs:
        raise InputError(f"{name} has no frame in which all markers were seen.")
    longest = max(runs, key=lambda run: run[1] - run[0])
    if start is None and end is None:
        return slice(*longest), *longest
    first, stop = check_range(start, end, len(points), name)
    for run in runs:
        if run[0] <= first and stop <= run[1]:
            return slice(*run), first, stop
    raise InputError(
        f"Markers are missing within frames {first} to {stop} of {name}; its longest "
        f"stretch without long gaps is {longest[0]} to {longest[1]}."
    )


def _all_seen(points: Array) -> NDArray[np.bool_]:
    """Returns in which frames (T,) of ``points`` (T, ...) nothing is missing."""
    flat = points.reshape(len(points), -1)
    return np.asarray(np.isfinite(flat).all(axis=1), dtype=np.bool_)
