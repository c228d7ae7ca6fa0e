"""Guesses which points of a file are an animal's toes, and which axis points up.

A toe is the end of a chain, near the ground, and stands still while the trunk moves on.
The up axis is the one along which that is so and the other points are above the toes.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.errors import InputError
from loco_drake.datasets.bvh import END_SITE
from loco_drake.datasets.conventions import with_z_up
from loco_drake.datasets.named_points import NamedPoints
from loco_drake.datasets.skeleton import AXES

# Points seen in less than this share of the frames are left out.
_SEEN = 0.5
# A body that moves by more than this, in its sizes, travels.
_TRAVELS = 1.0
# ... and it moves on while it is faster than this share of its fast pace.
_MOVES = 0.4
# Percentiles of a toe's height and speed that lie within stance, also of a gallop.
_LOW, _SLOW = 10.0, 20.0
# Ends of chains that meet this near, in body sizes, are of one paw.
_PAW = 0.3
# Points of a table are of one limb if they stay this near, at a distance as constant.
_LIMB, _RIGID = 0.4, 0.12
_LIMB_STANDING = 0.15
# Costs that differ by less leave a doubt.
_CLEAR = 0.15


@dataclass(frozen=True)
class Toes:
    """Four toes in no order, and the points turned upright."""

    indices: tuple[int, ...]  # of the four toes
    up: str  # axis of the file that points up, such as -y
    points: Array  # all points with z up, in the file's unit, shape (T, N, 3)
    size: float  # twice the rms distance of the points from their middle
    travels: bool  # whether the body moves away
    moving: Bools  # in which frames it moves, if it does at all, shape (T,)
    doubts: tuple[str, ...]


def guess_toes(named: NamedPoints) -> Toes:
    """Returns the four points of a file that are most like toes.

    Raises:
        InputError: if it holds no four limbs, or too few frames.
    """
    points, usable = fill_gaps(named.positions)
    centre = points[:, usable].mean(axis=1)
    spread = np.linalg.norm(points[:, usable] - centre[:, None], axis=-1)
    size = 2 * float(np.median(np.sqrt((spread**2).mean(axis=1))))
    if not size > 0:
        raise InputError("its points are all in one place.")
    away = float(np.linalg.norm(centre - centre[0], axis=-1).max())
    travels = away > _TRAVELS * size
    speed = np.linalg.norm(np.gradient(points, axis=0), axis=-1)
    pace = np.linalg.norm(np.gradient(centre, axis=0), axis=-1)
    # Animals may sit and lie in between, when any point is still.
    on: Bools = pace > _MOVES * np.percentile(pace, 90) if travels else pace >= 0
    still = np.zeros(len(named.names))
    if travels:
        still = np.percentile(speed[on], _SLOW, axis=0) / pace[on].mean()
    candidates = [k for k in _ends(named) if usable[k]]
    limbs = _limbs(named, points, candidates, size, travels)
    choices = []
    for up in AXES:
        turned = with_z_up(points, "xyz".index(up[-1]), len(up) == 1)
        level = np.percentile(turned[on, :, 2], _LOW, axis=0)
        cost = level / size + still
        order = sorted(candidates, key=lambda k: cost[k])
        chosen = [
            min((c for c in candidates if limbs[k, c]), key=lambda c: level[c])
            for k in _distinct(order, limbs, 5)
        ]
        if len(chosen) < 4:
            raise InputError(
                f"no four legs are to be told in it; it has {named.listing()}."
            )
        above = np.median(
            (turned[:, usable].mean(axis=1) - turned[:, chosen[:4]].mean(axis=1))[on],
            axis=0,
        )
        upright = above[2] / max(float(np.linalg.norm(above)), 1e-9)
        uneven = sum(cost[k] - cost[chosen[0]] for k in chosen[:4]) / 4
        # Over time the lowest point of a body on its feet is at one height.
        lowest = np.ptp(
            np.percentile(turned[on][:, candidates, 2].min(axis=1), (10, 90))
        )
        doubt = 2 * (1 - upright) + uneven + still[chosen[:4]].mean()
        doubt += 2 * lowest / size
        choices.append((doubt, up, turned, chosen, cost))
    choices.sort(key=lambda choice: choice[0])
    _, up, turned, chosen, cost = choices[0]
    doubts = []
    if not travels:
        turned, belt = _over_ground(turned, chosen[:4], size)
        travels = belt
        if belt:
            doubts.append(
                "The feet that stand slide backward, as on a treadmill, which is not "
                "taken out of the recording: motion made of it would slip."
            )
    if choices[1][0] - choices[0][0] < _CLEAR:
        doubts.append(f"Up may as well be {choices[1][1]} as {up}.")
    if len(chosen) > 4 and cost[chosen[4]] - cost[chosen[3]] < _CLEAR:
        fourth, fifth = (named.path(k) for k in chosen[3:5])
        doubts.append(f"{fifth} is as much like a toe as {fourth}.")
    return Toes(tuple(chosen[:4]), up, turned, size, travels, on, tuple(doubts))


def _over_ground(points: Array, toes: list[int], size: float) -> tuple[Array, bool]:
    """Returns points with z up as if a treadmill stood still, and whether there is one.

    It is as fast as low toes are in the median.
    """
    feet = points[1:, toes]
    low = feet[..., 2] <= np.percentile(feet[..., 2], 2 * _LOW, axis=0)
    steps = np.diff(points[:, toes], axis=0)[..., :2]
    belt = np.median(steps[low], axis=0)
    way = np.arange(len(points))[:, None] * belt
    if not np.linalg.norm(way[-1]) > 2 * _TRAVELS * size:
        return points, False
    moved = points.copy()
    moved[..., :2] -= way[:, None]
    return moved, True


def fill_gaps(positions: Array) -> tuple[Array, Bools]:
    """Returns points (T, N, 3) without gaps, and which of them (N,) are usable.

    Gaps are bridged by straight lines, good enough to guess by.

    Raises:
        InputError: if fewer than six points are seen in half of at least four frames.
    """
    points, frames = positions.copy(), np.arange(len(positions))
    seen: Bools = np.asarray(np.isfinite(points).all(axis=-1), dtype=np.bool_)
    usable: Bools = seen.mean(axis=0) >= _SEEN
    if len(points) < 4 or usable.sum() < 6:
        raise InputError(
            "it needs at least 4 frames and 6 points, not "
            f"{len(points)} and {usable.sum()}."
        )
    for k in np.flatnonzero(~seen.all(axis=0)):
        for axis in range(3):
            points[:, k, axis] = (
                np.interp(frames, frames[seen[:, k]], points[seen[:, k], k, axis])
                if usable[k]
                else 0.0
            )
    return points, usable


def _ends(named: NamedPoints) -> list[int]:
    """Returns ends of chains; of one at its joint's place, the joint, which has a name.

    Of a table they are all points.
    """
    if not named.is_tree:
        return list(range(len(named.names)))
    leaves = set(range(len(named.names))) - set(named.parents)
    ends = []
    for leaf in sorted(leaves):
        parent = named.parents[leaf]
        apart = named.positions[0, leaf] - named.positions[0, parent]
        at_joint = named.names[leaf] == END_SITE and np.linalg.norm(apart) < 1e-6
        ends.append(parent if at_joint else leaf)
    return ends


def _limbs(
    named: NamedPoints, points: Array, candidates: list[int], size: float, moves: bool
) -> dict[tuple[int, int], bool]:
    """Returns of each pair of candidates whether they are of one limb."""
    found = {(k, k): True for k in candidates}
    for a, b in combinations(candidates, 2):
        if named.is_tree:
            top = common_joint(named, (a, b))
            far = max(chain_length(named, points, k, top) for k in (a, b))
            one = far < _PAW * size
        else:
            apart = np.linalg.norm(points[:, a] - points[:, b], axis=-1)
            low, middle, high = np.percentile(apart, (5, 50, 95))
            near = _LIMB if moves else _LIMB_STANDING
            rigid = middle < near * size and high - low < _RIGID * size
            one = bool(rigid or (moves and high < _PAW * size))
        found[a, b] = found[b, a] = one
    return found


def _distinct(
    order: Iterable[int], limbs: dict[tuple[int, int], bool], most: int
) -> list[int]:
    """Returns the first candidates that are of different limbs."""
    chosen: list[int] = []
    for k in order:
        if len(chosen) < most and not any(limbs[k, other] for other in chosen):
            chosen.append(k)
    return chosen


def common_joint(named: NamedPoints, indices: Iterable[int]) -> int:
    """Returns the lowest joint on which all of the points hang, or that one is."""
    first, *others = indices
    chains = [{k, *named.ancestors(k)} for k in others]
    return next(
        k for k in (first, *named.ancestors(first)) if all(k in c for c in chains)
    )


def chain_length(named: NamedPoints, points: Array, low: int, high: int) -> float:
    """Returns the length of the bones from a joint up to one of its ancestors."""
    length = 0.0
    while low != high:
        parent = named.parents[low]
        bone = np.linalg.norm(points[:, low] - points[:, parent], axis=-1)
        length += float(np.median(bone))
        low = parent
    return length
