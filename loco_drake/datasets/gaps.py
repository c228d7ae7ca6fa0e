"""Gaps: frames of a recording in which the cameras did not see a point."""

import numpy as np
from scipy.interpolate import CubicSpline

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.runs import intervals
from loco_drake.datasets.recording import all_seen, check_range

# Gaps up to this long are bridged, s.
LONGEST_GAP = 0.1


def mend_gaps(points: Array, longest: int) -> tuple[Array, int]:
    """Returns points (T, N, 3) with short gaps bridged by splines, and their frames.

    Gaps at an end, or of more than ``longest`` frames, stay.
    """
    points = points.copy()
    bridged = np.zeros(len(points), dtype=bool)
    frames = np.arange(len(points))
    for marker in range(points.shape[1]):
        seen = all_seen(points[:, marker])
        if seen.all() or seen.sum() < 4:
            continue
        spline = CubicSpline(frames[seen], points[seen, marker])
        for start, end in intervals(~seen):
            if end - start <= longest and start > 0 and end < len(points):
                points[start:end, marker] = spline(frames[start:end])
                bridged[start:end] = True
    return points, int(bridged.sum())


def usable_stretch(
    points: Array, start: int | None, end: int | None
) -> tuple[slice, int]:
    """Returns the frames without gaps around a stretch, and its first frame.

    Without ``start`` and ``end`` it is the longest there is. Raises InputError if it
    does not lie within the file, or has a gap.
    """
    whole = all_seen(points)
    runs = list(intervals(whole))
    if not runs:
        raise InputError("it has no frame in which all points were seen.")
    longest = max(runs, key=lambda run: run[1] - run[0])
    if start is None and end is None:
        return slice(*longest), longest[0]
    first, stop = check_range(start, end, len(points))
    for run in runs:
        if run[0] <= first and stop <= run[1]:
            return slice(*run), first
    raise InputError(
        f"points are missing within frames {first} to {stop} of it; its longest "
        f"stretch without long gaps is {longest[0]} to {longest[1]}."
    )
