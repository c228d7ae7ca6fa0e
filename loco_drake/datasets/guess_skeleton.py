"""Guesses the skeleton of a file of which nothing is known, and says what is doubtful.

Front and rear follow from the way the animal moves, left and right from that and the up
axis, and the unit of length from gravity: bodies of one build have similar strides when
time is scaled by sqrt(height / g).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.errors import InputError
from loco_drake.common.gravity import GRAVITY
from loco_drake.datasets.guess_toes import Toes, common_joint, guess_toes
from loco_drake.datasets.guess_trunk import guess_trunk
from loco_drake.datasets.joint_names import end_of, side_of
from loco_drake.datasets.named_points import NamedPoints
from loco_drake.datasets.skeleton import UNITS, Skeleton, pick
from loco_drake.models.legs import LEGS
from loco_drake.motion.gait_timing import GaitTiming, Track, gait_timing

# The period of a stride over sqrt(height / g) is exp(A + B duty factor) to .21 in its
# logarithm, in 120 stretches of dog and horse from walk to gallop.
_PERIOD = (0.157, 1.415)
# Units that put the height within this factor of that are all possible.
_FACTOR = 2.6
# A clip of several gaits has a rhythm in parts only: halves, thirds, ...
_PARTS = (1, 2, 3, 4, 6, 9)
# Heights of trunks, m, for a clip without strides.
_HEIGHTS = (0.1, 1.8)
# A trunk that moves along itself by less than this share of its path goes elsewhere.
_ALONG = 0.7
# Toes lower than this share of the stance height stand.
_STANDS = 0.04
# Toes stand this much of the stance height off their points before it matters.
_STRAIGHT_DOWN = 0.05


@dataclass(frozen=True)
class Guess:
    """A skeleton, and what it was guessed by."""

    skeleton: Skeleton
    joints: dict[str, tuple[int, ...]]  # withers, hip, FL, FR, RL, RR: their points
    fps: float | None  # frames per second, None if the file does not tell
    height: float  # of the trunk over the toes, in the file's unit
    speed: float | None  # of the trunk in the file's unit per second
    timing: GaitTiming | None  # None if there are no three strides, or no rate
    doubts: tuple[str, ...]  # sentences


def guess_skeleton(named: NamedPoints, fps: float | None = None) -> Guess:
    """Returns the skeleton that the points and their motion suggest.

    Args:
        named: the points of a file.
        fps: its rate, by default that in the file.

    Raises:
        InputError: if no four legs or no trunk are to be told.
    """
    rate = fps or named.fps
    toes = guess_toes(named)
    doubts = list(toes.doubts)
    legs = _order(named, toes, doubts)
    withers, hip = guess_trunk(named, toes, legs, doubts)
    joints: dict[str, tuple[int, ...]] = {"withers": withers, "hip": hip}
    joints |= {leg: (k,) for leg, k in zip(LEGS, legs, strict=True)}
    skeleton = Skeleton(
        withers=_paths(named, withers),
        hip=_paths(named, hip),
        toes={leg: named.path(k) for leg, k in zip(LEGS, legs, strict=True)},
        up=toes.up,
        fps=fps if named.fps is None else None,
    )
    upright = replace(named, positions=toes.points)
    points = pick(upright, skeleton.points)
    points[..., 2] -= np.percentile(points[:, 2:, 2], 10)
    track, height = _track(points, toes.moving, rate or 1.0)
    timing = _rhythm(track) if rate else None
    skeleton.units = _unit(height, timing, doubts)
    if rate is None:
        doubts.append("The file does not tell its rate: add it as fps.")
    skeleton.retargeting = _virtual_hips(points[toes.moving], height)
    middle = track.trunk
    path = np.linalg.norm(np.diff(middle, axis=0), axis=-1).sum()
    speed = rate * float(path) / (len(middle) - 1) if rate else None
    return Guess(skeleton, joints, rate, height, speed, timing, tuple(doubts))


def _order(named: NamedPoints, toes: Toes, doubts: list[str]) -> list[int]:
    """Returns the toes FL, FR, RL, RR."""
    pairs = _girdles(named, toes)
    ground = toes.points[..., :2]
    centre = ground.mean(axis=1)
    velocity = np.gradient(centre, axis=0)
    axis = ground[:, pairs[0]].mean(axis=1) - ground[:, pairs[1]].mean(axis=1)
    axis /= np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-9)
    path = np.linalg.norm(velocity, axis=-1).sum()
    along = float((velocity * axis).sum() / max(path, 1e-9))
    named_ends = [_told(named, pair, end_of) for pair in pairs]
    turned = along < 0
    if named_ends in (["front", "rear"], ["rear", "front"]):
        by_name = named_ends == ["rear", "front"]
        if toes.travels and abs(along) > _ALONG and by_name != turned:
            doubts.append("By the names of its joints, the animal moves backward.")
        turned = by_name
    elif not toes.travels or abs(along) < _ALONG:
        doubts.append(
            "Which legs are in front is not to be told, since the animal does not move "
            "along its trunk; exchange FL with RL and FR with RR if they are the rear "
            "ones, and left with right."
        )
    if turned:
        pairs, axis = pairs[::-1], -axis
    left = np.stack((-axis[:, 1], axis[:, 0]), axis=-1)
    ordered: list[int] = []
    for a, b in pairs:
        apart = float(((ground[:, a] - ground[:, b]) * left).sum(axis=-1).mean())
        ordered += [a, b] if apart > 0 else [b, a]
    sides = [side_of(named, k) for k in ordered]
    if sides == ["right", "left"] * 2:
        doubts.append(
            "By the names of its joints, left and right are exchanged: its axes are "
            "left-handed, or it is a mirror image."
        )
    elif any(
        s not in (None, t) for s, t in zip(sides, ["left", "right"] * 2, strict=True)
    ):
        doubts.append("The names of the joints contradict the sides of the toes.")
    return ordered


def _girdles(named: NamedPoints, toes: Toes) -> list[list[int]]:
    """Returns two pairs of toes, those of the front and those of the rear legs.

    A skeleton tells which legs hang on one joint. Otherwise the pairs are those that
    lie one before the other along the way, or along the body.
    """
    a, b, c, d = toes.indices
    splits = [[[a, b], [c, d]], [[a, c], [b, d]], [[a, d], [b, c]]]
    if named.is_tree:
        depths = [
            sum(len(named.ancestors(common_joint(named, pair))) for pair in split)
            for split in splits
        ]
        if sorted(depths)[-1] > sorted(depths)[-2]:
            return splits[int(np.argmax(depths))]
    ground = toes.points[..., :2]
    velocity = np.gradient(ground.mean(axis=1), axis=0)
    pace = np.linalg.norm(velocity, axis=-1, keepdims=True)
    way = velocity / np.maximum(pace, 1e-9)

    def apart(split: list[list[int]]) -> float:
        axis = ground[:, split[0]].mean(axis=1) - ground[:, split[1]].mean(axis=1)
        if toes.travels:
            return abs(float((axis * way).sum(axis=-1).mean()))
        return float(np.linalg.norm(axis, axis=-1).mean())

    return max(splits, key=apart)


def _told(
    named: NamedPoints, pair: list[int], tell: Callable[[NamedPoints, int], str | None]
) -> str | None:
    """Returns what the names of both joints tell, None if they differ."""
    first, second = (tell(named, k) for k in pair)
    return first if first == second else None


def _paths(named: NamedPoints, indices: tuple[int, ...]) -> str | list[str | int]:
    paths: list[str | int] = [named.path(k) for k in indices]
    return str(paths[0]) if len(paths) == 1 else paths


def _track(points: Array, moving: Bools, rate: float) -> tuple[Track, float]:
    """Returns the track of points (T, 6, 3), z up, and the height of a moving trunk."""
    spine = points[:, 0] - points[:, 1]
    middle = points[:, :2].mean(axis=1)
    height = float(np.median(middle[moving, 2]))
    if not height > 0:
        raise InputError("no trunk over its legs is to be told.")
    soles = points[:, 2:] - [0.0, 0.0, 1.0] * np.percentile(
        points[:, 2:, 2:], 10, axis=0
    )
    yaw = np.arctan2(spine[:, 1], spine[:, 0])
    return Track(rate, middle[:, :2], yaw, soles, height), height


def _rhythm(track: Track) -> GaitTiming | None:
    """Returns the gait timing of a track, or of the longest part that has a rhythm."""
    frames = len(track.yaw)
    for parts in _PARTS:
        length = frames // parts
        for start in range(0, frames - length + 1, max(length // 2, 1)):
            part = slice(start, start + length)
            timing = gait_timing(
                replace(
                    track,
                    trunk=track.trunk[part],
                    yaw=track.yaw[part],
                    soles=track.soles[part],
                )
            )
            if timing is not None:
                return timing
    return None


def _unit(height: float, timing: GaitTiming | None, doubts: list[str]) -> str:
    """Returns the unit of length that makes the height fit the strides best."""
    if timing is None:
        fit = [u for u in UNITS if _HEIGHTS[0] <= height * UNITS[u] <= _HEIGHTS[1]]
        unit = fit[0] if fit else "m"
        others = fit[1:]
        reason = "Without three strides the unit is not to be told"
    else:
        duty = float(timing.duty_factors.mean())
        period = np.exp(_PERIOD[0] + _PERIOD[1] * duty)
        likely = GRAVITY * (timing.stride_period / period) ** 2
        off = {u: abs(np.log(height * m / likely)) for u, m in UNITS.items()}
        unit, *others = sorted(UNITS, key=lambda u: off[u])
        others = [u for u in others if off[u] < np.log(_FACTOR)]
        reason = f"Strides of {timing.stride_period:.2g} s do not tell the unit well"
        if off[unit] > np.log(_FACTOR):
            others = []
            doubts.append(
                f"In no unit does a trunk {height:.3g} high suit strides of "
                f"{timing.stride_period:.2g} s: check rate and units."
            )
    if others or timing is None:
        heights = [f"{height * UNITS[u]:.2g} m high in {u}" for u in (unit, *others)]
        doubts.append(f"{reason}: the trunk is {' or '.join(heights)}.")
    return unit


def _virtual_hips(points: Array, height: float) -> dict[str, float]:
    """Returns where toes stand from withers and hip, as retargeting's fields.

    The robot's legs then hang straight down in the middle of stance.
    """
    ahead = (points[:, 0] - points[:, 1])[:, :2]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=-1)
    offsets = (points[:, 2:] - points[:, [0, 0, 1, 1]])[..., :2] / height
    heights = points[:, 2:, 2] - np.percentile(points[:, 2:, 2], 10, axis=0)
    stands = (heights < _STANDS * height).astype(float)
    share = stands / np.maximum(stands.sum(axis=0), 1.0)
    along = ((offsets * ahead[:, None]).sum(axis=-1) * share).sum(axis=0)
    aside = ((offsets * left[:, None]).sum(axis=-1) * share).sum(axis=0)
    found = {
        "front_hip": along[:2].mean(),
        "rear_hip": along[2:].mean(),
        "hip_spread": (aside[0::2] - aside[1::2]).mean() / 2,
    }
    rounded = {name: round(float(value), 2) for name, value in found.items()}
    return {k: v for k, v in rounded.items() if abs(v) >= _STRAIGHT_DOWN}
