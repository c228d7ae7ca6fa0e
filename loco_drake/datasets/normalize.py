"""What all readers do to bring a recording into the form of a KeypointClip."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError

Array = NDArray[np.float64]


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


def check_steps(points: Array, max_step: float, path: Path, what: str) -> None:
    """Checks that no point moves further than ``max_step`` m from frame to frame.

    Args:
        points: in m, shape (T, N, 3).
        max_step: more than any true point does, so that lines are missing or shuffled.
        path: the file, for the message.
        what: its format, for the message: "a dog keypoint file".

    Raises:
        InputError: naming the first frame after a jump.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=-1, initial=0.0)
    if (steps > max_step).any():
        frame = int(np.argmax(steps > max_step)) + 1
        raise InputError(
            f"{path} is not {what}: at frame {frame} a point jumps by more than "
            f"{max_step} m (are lines missing or out of order?)."
        )


def ground_toes(toes: Array, percentile: float) -> Array:
    """Returns toes (T, 4, 3) whose own low percentile of height is 0.

    Markers sit at different heights on each foot, constant within a recording; each
    foot touches the ground often enough that a low percentile is its height in stance.
    """
    offsets = np.percentile(toes[..., 2], percentile, axis=0)
    grounded: Array = toes - np.stack((0 * offsets, 0 * offsets, offsets), axis=-1)
    return grounded


def start_along_x(
    withers: Array, hip: Array, toes: Array
) -> tuple[Array, Array, Array]:
    """Returns the points turned and shifted so that the clip starts along +x.

    The first frame's horizontal direction from hip to withers becomes +x, the point
    under the middle between them the origin; heights are left alone.

    Args:
        withers: shape (T, 3).
        hip: shape (T, 3).
        toes: shape (T, 4, 3).

    Raises:
        InputError: if the trunk stands upright in the first frame, so that it has no
            heading.
    """
    x, y, _ = withers[0] - hip[0]
    length = np.hypot(x, y)
    if length < 1e-6:
        raise InputError(
            "The clip starts with the withers right above the hip: it has no heading."
        )
    c, s = x / length, y / length
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    origin = (withers[0] + hip[0]) / 2 * np.array([1.0, 1.0, 0.0])
    withers, hip, toes = ((points - origin) @ R.T for points in (withers, hip, toes))
    return withers, hip, toes
