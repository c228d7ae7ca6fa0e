"""Where the feet of a plan go whose path on the ground was bent.

A foot that stands is carried over by the transform of the path at the middle of its
stance, and stays there. A foot that swings moves with the base, with an offset that
goes smoothly from one foothold to the next.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.rotations import rotate_plane
from loco_drake.control.plan import Plan

# Samples before touchdown from which a foot's landing no longer changes.
_LATE = 6


@dataclass(frozen=True)
class Bend:
    """A plan's path on the ground before and after it was bent.

    Nothing changes up to sample ``last``. The rows are those of the plan.
    """

    raw: Plan  # the plan before
    raw_pose: Array  # of its base on the ground, x, y, yaw, shape (N, 3)
    pose: Array  # the same of the bent path
    lean: Array  # by how much feet are displaced in a turn, m in W, shape (N, 2)
    last: int

    @property
    def turn(self) -> Array:
        """By how much the base is turned, rad, shape (N,)."""
        turn: Array = self.pose[:, 2] - self.raw_pose[:, 2]
        return turn

    def carried(self) -> Array:
        """Returns where toes are if they move with the base, m in W, (N, 4, 2)."""
        p_BoF_W = self.raw.p_WF[..., :2] - self.raw_pose[:, None, :2]
        return (
            self.lean[:, None]
            + self.pose[:, None, :2]
            + rotate_plane(p_BoF_W, self.turn[:, None])
        )

    def placed(self, toe: Array, middle: float) -> tuple[Array, Array]:
        """Returns where positions (M, 2) of a toe are in a stance, and its turn, (1,).

        The transform is that of the path at sample ``middle``.
        """
        angle = _between(self.turn[:, None], middle)
        from_ = _between(self.raw_pose[:, :2], middle)
        to = _between(self.pose[:, :2] + self.lean, middle)
        return to + rotate_plane(toe - from_, angle), angle


def toe_offsets(bend: Bend, carried: Array, before: Array) -> Array:
    """Returns how far toes are from where they move with the base, m in W, (N, 4, 2).

    Args:
        bend: the plan and its paths.
        carried: its :meth:`Bend.carried`.
        before: the offsets so far, shape (M, 4, 2), M above ``bend.last``.
    """
    return np.stack(
        [
            _toe_offset(bend, foot, carried[:, foot], before[:, foot])
            for foot in range(4)
        ],
        axis=1,
    )


def _toe_offset(bend: Bend, foot: int, carried: Array, before: Array) -> Array:
    """Returns the offset of one foot, (N, 2), from ``carried`` and ``before``."""
    last = bend.last
    toe = bend.raw.p_WF[:, foot, :2]
    slope_toe, slope_carried = (np.gradient(a, axis=0) for a in (toe, carried))
    offset = np.zeros_like(toe)
    offset[: last + 1] = before[: last + 1]
    # Where a swing begins: sample, offset and its slope per sample.
    begun, slope = last, _slope(before, last)
    usual = 0  # samples of a stance that is complete
    for start, end in _stances(bend.raw.contacts[:, foot], last):
        span = slice(max(start, last + 1), end + 1)
        late = start - last <= _LATE and start < len(before)
        if late:
            # The foot stands already, or lands where it was going to.
            swing = slice(last + 1, start)
            offset[swing] = before[swing]
            here = max(start, last)
            placed = carried[here] + before[here]
            angle = bend.turn[here, None]
            offset[span] = (
                placed + rotate_plane(toe[span] - toe[here], angle) - carried[span]
            )
        else:
            middle = (start + end) / 2
            if end == len(toe) - 1 and bend.raw.open_ended:
                middle = max(middle, start + usual / 2)
            placed, angle = bend.placed(toe[span], middle)
            offset[span] = placed - carried[span]
            there = rotate_plane(slope_toe[start], angle[0]) - slope_carried[start]
            offset[begun + 1 : start] = _hermite(
                offset[begun], slope, offset[start], there, start - begun
            )
        begun, usual = end, end - start
        slope = rotate_plane(slope_toe[end], angle[0]) - slope_carried[end]
    if begun < len(toe) - 1:
        left = len(toe) - begun
        offset[begun + 1 :] = _hermite(offset[begun], slope, 0 * slope, 0 * slope, left)
    return offset


def _slope(rows: Array, index: int) -> Array:
    """Returns the central difference of (N, D) at a row, one-sided at the ends."""
    low, high = max(index - 1, 0), min(index + 1, len(rows) - 1)
    slope: Array = (rows[high] - rows[low]) / max(high - low, 1)
    return slope


def _stances(contact: Bools, last: int) -> Iterator[tuple[int, int]]:
    """Yields first and last sample of the stances that end after sample ``last``."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], contact, [False]))))
    for start, end in zip(edges[::2], edges[1::2] - 1, strict=True):
        if end > last:
            yield int(start), int(end)


def _hermite(a: Array, slope_a: Array, b: Array, slope_b: Array, steps: int) -> Array:
    """Returns the inner points of a cubic from ``a`` to ``b``, (steps - 1, 2)."""
    x = (np.arange(1, steps) / steps)[:, None]
    rest = 1 - x
    return rest * rest * ((1 + 2 * x) * a + x * steps * slope_a) + x * x * (
        (1 + 2 * rest) * b - rest * steps * slope_b
    )


def _between(rows: Array, index: float) -> Array:
    """Returns the row of (N, D) at a fractional index, by linear interpolation."""
    low = min(int(index), len(rows) - 1)
    high = min(low + 1, len(rows) - 1)
    return rows[low] + (index - low) * (rows[high] - rows[low])
