"""Recording, the result of a reader, and Body, the bounds of its source."""

from collections.abc import Sized
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError

Array = NDArray[np.float64]

# Plausible rates of cameras and simulators, frames/s.
RATES = (10.0, 1000.0)
# Needed for interpolation.
MIN_FRAMES = 4


@dataclass(frozen=True)
class Recording:
    """Six points of an animal or robot over a whole file, in metres.

    Up axis, ground and the order of toes need not follow the conventions, since
    :mod:`loco_drake.datasets.conventions` measures them.

    Attributes:
        points: withers, hip, toes FL, FR, RL, RR, shape (T, 6, 3).
        fps: frames per second.
        first: number in the file of the first of these frames.
        start: number in the file of the first usable frame, the default start.
        notes: corrections, for the clip's provenance.
    """

    points: Array
    fps: float
    first: int = 0
    start: int | None = None
    notes: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Body:
    """Bounds that all recordings of a source satisfy.

    Attributes:
        trunk: range of the distance between withers and hip, m.
        height: range of the height of the trunk's middle over the toes in stance, m.
        stride: range of the stride period, in units of sqrt(height / g).
        jump: largest deviation of a toe from linear extrapolation of its last two
            frames, as a share of the larger of trunk and height.
        markers: whether toes are markers with individual height offsets, rather than
            exact points.
    """

    trunk: tuple[float, float] = (0.03, 5.0)
    height: tuple[float, float] = (0.03, 5.0)
    stride: tuple[float, float] = (0.5, 10.0)
    jump: float = 0.4
    markers: bool = True


def check_rate(fps: float, of: str) -> float:
    """Returns a rate in frames/s if it is plausible.

    Args:
        fps: the rate.
        of: what has it, for the message.

    Raises:
        InputError: if not.
    """
    low, high = RATES
    if not low <= fps <= high:
        raise InputError(
            f"{of} has {fps:g} frames/s, which is not plausible: a rate is {low:g} to "
            f"{high:g} frames/s (is a time in ms, or a step given for a rate?)."
        )
    return fps


def check_frames(frames: Sized, path: Path) -> None:
    """Raises InputError if there are fewer than :data:`MIN_FRAMES` frames."""
    if len(frames) < MIN_FRAMES:
        raise InputError(
            f"{path}: a recording needs at least {MIN_FRAMES} frames, not "
            f"{len(frames)}."
        )


def check_told(told: float, fps: float | None, path: Path, what: str) -> float:
    """Returns the rate inferred from the motion, or the given one if it agrees.

    Raises:
        InputError: if they differ by more than a third.
    """
    if fps is not None and not 0.75 < fps / told < 4 / 3:
        raise InputError(
            f"{path} is not {what} at {fps:g} frames/s: its motion tells that it has "
            f"{told:g}; leave the rate away, or correct it."
        )
    return told if fps is None else fps


def all_seen(points: Array) -> NDArray[np.bool_]:
    """Returns for each frame (T,) of ``points`` (T, ...) whether it is complete."""
    flat = points.reshape(len(points), -1)
    return np.asarray(np.isfinite(flat).all(axis=1), dtype=np.bool_)


def check_range(
    start: int | None, end: int | None, frames: int, what: str
) -> tuple[int, int]:
    """Returns ``(start, end)`` of a stretch, ``end`` exclusive.

    None stands for the first frame, or for the frame after the last.

    Raises:
        InputError: if the stretch does not lie within ``frames`` frames.
    """
    first = 0 if start is None else start
    stop = frames if end is None else end
    if not 0 <= first < stop <= frames:
        raise InputError(
            f"Frames {first} to {stop} (exclusive) do not lie within {what}, "
            f"which has {frames} frames."
        )
    return first, stop


def start_along_x(points: Array) -> Array:
    """Returns points (T, 6, 3) turned and shifted so that they start along +x.

    The first frame's horizontal direction from hip to withers becomes +x, the point
    under the middle between them the origin; heights are left alone.

    Raises:
        InputError: if the trunk stands upright in the first frame, so that it has no
            heading.
    """
    withers, hip = points[0, 0], points[0, 1]
    x, y, _ = withers - hip
    length = np.hypot(x, y)
    if length < 1e-6:
        raise InputError(
            "The clip starts with the withers right above the hip: it has no heading."
        )
    c, s = x / length, y / length
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    origin = (withers + hip) / 2 * np.array([1.0, 1.0, 0.0])
    along: Array = (points - origin) @ R.T
    return along
