"""Guesses which points of a file are an animal's withers and hip.

They lie on the trunk, high over the front and the rear toes. On a skeleton they are
joints of the spine between the legs; where none is near, the middle between the upper
ends of two legs takes the place. Of a table they may be any two points.
"""

from itertools import combinations

import numpy as np

from loco_drake.common.errors import InputError
from loco_drake.datasets.guess_toes import Toes, common_joint
from loco_drake.datasets.named_points import NamedPoints

# Of the height of the highest candidate over the toes.
_HIGH = 0.5
# Distance from straight above the toes, in lengths of the trunk, that leaves a doubt.
_FAR = 0.45
# Two points count as one in the middle if that is this near to the midline, one is as
# far ahead as the other, and each is further than this on its side.
_MIDLINE, _LEVEL, _ASIDE = 0.1, 0.2, 0.04
# Height weighs less than the place over the toes, and a middle is second choice.
_HEIGHT_WEIGHT, _MIDDLE_COST = 0.3, 0.1
# Points of a table with a toe's limb.
_RIGID, _LIMB = 0.08, 0.6

_MOST_POINTS = 60

Indices = tuple[int, ...]


def guess_trunk(
    named: NamedPoints, toes: Toes, legs: list[int], doubts: list[str]
) -> tuple[Indices, Indices]:
    """Returns the points of withers and hip, each one or two whose middle it is.

    Args:
        named: the points.
        toes: with them turned upright.
        legs: toes FL, FR, RL, RR.
        doubts: to which sentences are added.

    Raises:
        InputError: if there is no point over the toes.
    """
    ground = toes.points[:, legs].copy()
    front, rear = ground[:, :2].mean(axis=1), ground[:, 2:].mean(axis=1)
    axis = (front - rear)[:, :2]
    length = float(np.median(np.linalg.norm(axis, axis=-1)))
    axis = axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-9)
    left = np.stack((-axis[:, 1], axis[:, 0]), axis=-1)
    level = float(np.percentile(ground[..., 2], 10))
    found: list[Indices] = []
    for name, over, pair in (("withers", front, legs[:2]), ("hip", rear, legs[2:])):
        taken = {k for point in found for k in point}
        choices = [c for c in _candidates(named, toes, legs, pair) if not taken & {*c}]
        heights = {
            c: float(np.median(toes.points[:, list(c), 2])) - level for c in choices
        }
        top = max(heights.values(), default=0.0)
        best, cost, distance = None, np.inf, 0.0
        for choice in choices:
            each = (toes.points[:, list(choice)] - over[:, None])[..., :2]
            aheads = (each * axis[:, None]).sum(axis=-1).mean(axis=0) / length
            asides = (each * left[:, None]).sum(axis=-1).mean(axis=0) / length
            ahead, aside = abs(aheads.mean()), abs(asides.mean())
            middle = len(choice) == 2
            opposite = asides.min() < -_ASIDE and asides.max() > _ASIDE
            paired = opposite and aside < _MIDLINE and np.ptp(aheads) < _LEVEL
            if heights[choice] < _HIGH * top or (middle and not paired):
                continue
            total = ahead + aside + _MIDDLE_COST * middle
            total -= _HEIGHT_WEIGHT * heights[choice] / top
            if total < cost:
                best, cost, distance = choice, total, float(np.hypot(ahead, aside))
        if best is None:
            raise InputError(f"no {name} is to be told; it has {named.listing()}.")
        found.append(best)
        if distance > _FAR:
            doubts.append(
                f"The {name}, {' and '.join(named.path(k) for k in best)}, may be "
                f"another joint: it is {distance:.1f} of the trunk's length from "
                "straight above its toes."
            )
    return found[0], found[1]


def _candidates(
    named: NamedPoints, toes: Toes, legs: list[int], pair: list[int]
) -> list[Indices]:
    """Returns what can be the withers, or the hip, over a pair of toes."""
    if not named.is_tree:
        free = [k for k in range(len(named.names)) if not _of_limb(toes, k, legs)]
        pairs = combinations(free, 2) if len(free) <= _MOST_POINTS else ()
        return [*((k,) for k in free), *pairs]
    top = common_joint(named, legs)
    girdle = common_joint(named, pair)
    other = common_joint(named, [k for k in legs if k not in pair])
    spine = {girdle, other, top}
    for joint in (girdle, other):
        above = [joint, *named.ancestors(joint)]
        spine.update(above[: above.index(top)])
    in_leg = {
        k
        for toe in legs
        for k in (toe, *named.ancestors(toe))
        if sum(k in (t, *named.ancestors(t)) for t in legs) == 1
    }
    # The base of the neck, or of the tail.
    spine.update(
        k
        for k, parent in enumerate(named.parents)
        if parent == girdle and k not in in_leg and pair == legs[:2]
    )
    tops = [
        next(k for k in reversed((toe, *named.ancestors(toe))) if k in in_leg)
        for toe in pair
    ]
    return [*((k,) for k in sorted(spine)), (tops[0], tops[1])]


def _of_limb(toes: Toes, index: int, legs: list[int]) -> bool:
    """Whether a point of a table is a toe, or moves with one."""
    for toe in legs:
        apart = np.linalg.norm(toes.points[:, index] - toes.points[:, toe], axis=-1)
        low, middle, high = np.percentile(apart, (5, 50, 95))
        near: bool = middle < _LIMB * toes.size
        if index == toe or (toes.travels and near and high - low < _RIGID * toes.size):
            return True
    return False
