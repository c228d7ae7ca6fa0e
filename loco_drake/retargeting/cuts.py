"""Proposes where to cut a recording that stands at first, or holds several gaits.

A frame is *down* where the animal is not on its feet (:func:`.contacts.on_feet`), and
*standing* where its trunk is slow and all four toes are on the ground
(:func:`.contacts.detect_contacts`). Elsewhere it moves, and a window of about two
strides slides along: the lags of its feet behind each other (:mod:`.gait_timing`) tell
the gait, *moving* where they have no rhythm, or none that is known. Neighbours alike
make a stretch. Thresholds are in units of the animal: its stance height h, the time
sqrt(h / g) and the speed sqrt(g h).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.gravity import GRAVITY
from loco_drake.common.runs import intervals
from loco_drake.motion.gait_timing import GaitTiming, clip_track, gait_timing
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.contacts import detect_contacts, on_feet, stance_height
from loco_drake.retargeting.correction import smooth
from loco_drake.retargeting.scaling import load_config

DOWN, STANDING, MOVING = "down", "standing", "moving"

# A slower trunk stands, in sqrt(g h); a walk is .3 and more.
_SLOW = 0.06
_SPEED_HZ = 1.0
# Windows in sqrt(h / g), the longer where the shorter holds no two strides, and the
# step between them. Strides last 1.7 to 4.4.
_WINDOWS, _STEP = (7.0, 10.0), 0.5
# Shorter stretches go to their neighbours, in sqrt(h / g).
_SHORTEST = 4.0
# Lags, in strides, that differ by less from half a stride, or from none, count as that.
_HALF = 0.2
_TROT, _PACE = 0.13, 0.13
_TOGETHER, _GALLOP = 0.1, 0.4


@dataclass(frozen=True)
class Cut:
    """A stretch of a recording in which an animal does one thing."""

    start: int  # first frame in the file
    end: int  # frame after the last
    guess: str  # DOWN, STANDING, MOVING, or like which gait it moves
    seconds: float
    speed_mean_mps: float
    stride_period_s: float | None  # None if it has no three strides


def propose_cuts(clip: KeypointClip) -> list[Cut]:
    """Returns the stretches of a clip, which follow each other without gaps.

    Raises:
        InputError: if the animal is never on its feet.
    """
    config = load_config(clip.source)
    height = stance_height(clip, config)
    unit = float(np.sqrt(height / GRAVITY)) * clip.fps
    contacts = detect_contacts(clip, height, config.contact)
    velocity = smooth(
        np.gradient(clip.middle[:, :2], 1 / clip.fps, axis=0), _SPEED_HZ, clip.fps
    )
    speed = np.linalg.norm(velocity, axis=-1)
    labels = np.full(len(clip), MOVING, dtype=object)
    stands = (speed < _SLOW * np.sqrt(GRAVITY * height)) & contacts.all(axis=1)
    labels[stands] = STANDING
    if config.stance_height is None:
        labels[~on_feet(clip)] = DOWN
    _absorb(labels, _SHORTEST * unit)
    for start, end in list(intervals(labels == MOVING)):
        labels[start:end] = _gaits(clip, height, start, end, unit)
    _absorb(labels, _SHORTEST * unit)
    first = int(clip.provenance.get("frames", "0").split("-")[0])
    cuts = []
    for start, end in _runs(labels):
        timing = _timing(clip, height, start, end)
        cut = Cut(
            start=first + start,
            end=first + end,
            guess=str(labels[start]),
            seconds=(end - start) / clip.fps,
            speed_mean_mps=float(speed[start:end].mean()),
            stride_period_s=timing.stride_period if timing else None,
        )
        cuts.append(cut)
    return cuts


def gait_of(timing: GaitTiming) -> str:
    """Returns the gait that the lags of the feet are like, or MOVING.

    Feet of a pair half a stride apart make a symmetrical gait, which the lag of a front
    foot behind the rear one of its side tells: none in a pace, half a stride in a trot,
    and a walk between. Pairs that land together, or nearly, make a bound or a gallop.
    """
    FL, FR, RL, RR = timing.phase_lags
    front, rear = _apart(FR - FL), _apart(RR - RL)
    if min(front, rear) > 0.5 - _HALF:
        lags = 2 * np.pi * np.array([FL - RL, FR - RR])
        lag = _apart(float(np.angle(np.exp(1j * lags).sum())) / (2 * np.pi))
        if lag > 0.5 - _TROT:
            return "trot"
        return "pace" if lag < _PACE else "walk"
    if max(front, rear) < _TOGETHER:
        return "bound"
    if max(front, rear) < _GALLOP and timing.duty_factors.mean() < 0.5:
        return "gallop"
    return MOVING


def _apart(lag: float) -> float:
    """Returns the distance of a lag from whole strides, 0 to .5."""
    return abs((lag + 0.5) % 1.0 - 0.5)


def _gaits(
    clip: KeypointClip, height: float, start: int, end: int, unit: float
) -> Array:
    """Returns the gait at each of the frames in which the animal moves."""
    step = max(round(_STEP * unit), 1)
    gaits = np.full(end - start, MOVING, dtype=object)
    for at in range(start, end, step):
        for window in _WINDOWS:
            half = round(window * unit / 2)
            # At the ends the window is cut on one side and longer on the other.
            low = max(start, min(at + step // 2 - half, end - 2 * half))
            timing = _timing(clip, height, low, min(low + 2 * half, end), strides=2)
            if timing is not None:
                gaits[at - start : at - start + step] = gait_of(timing)
                break
    return gaits


def _timing(
    clip: KeypointClip, height: float, start: int, end: int, strides: int = 3
) -> GaitTiming | None:
    if end - start < 4:
        return None
    part = replace(
        clip,
        withers=clip.withers[start:end],
        hip=clip.hip[start:end],
        toes=clip.toes[start:end],
    )
    return gait_timing(clip_track(part, height), strides)


def _runs(labels: Array) -> Iterator[tuple[int, int]]:
    """Yields start and end of runs of equal labels."""
    edges = [0, *(1 + np.flatnonzero(labels[1:] != labels[:-1])), len(labels)]
    yield from ((int(a), int(b)) for a, b in pairwise(edges))


def _absorb(labels: Array, shortest: float) -> None:
    """Gives runs that are too short to their longer neighbours, the shortest first."""
    while len(runs := list(_runs(labels))) > 1:
        k = min(range(len(runs)), key=lambda k: runs[k][1] - runs[k][0])
        start, end = runs[k]
        if end - start >= shortest:
            return
        beside = [j for j in (k - 1, k + 1) if 0 <= j < len(runs)]
        longer = max(beside, key=lambda j: runs[j][1] - runs[j][0])
        labels[start:end] = labels[runs[longer][0]]
