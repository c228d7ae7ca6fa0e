"""What the two simulated robots have in common: nine points, exact and rigid.

A file holds 27 comma-separated columns and no header: 9 points x (x, y, z) in metres,
z up: the centre of the trunk, four hips and four feet, in an order of its own.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.datasets.normalize import check_steps
from loco_drake.datasets.text import read_table

Array = NDArray[np.float64]

# At 50 frames/s a foot would swing at 7.5 m/s, three times what these robots do.
MAX_STEP = 0.15
# Rounding of the text and slack of the simulated joints, m.
RIGID_WITHIN = 0.005


def read_points(path: Path, what: str) -> Array:
    """Returns the points of a file of nine points in m, shape (T, 9, 3).

    Args:
        path: the file.
        what: its format, for messages: "an mpc keypoint file".

    Raises:
        InputError: if the file has another form.
    """
    points = read_table(path, 27, what).reshape(-1, 9, 3)
    check_steps(points, MAX_STEP, path, what)
    return points


def trunk_ends(
    centre: Array, hips: Array, half_size: tuple[float, float], path: Path, what: str
) -> tuple[Array, Array]:
    """Returns withers and hip: the middles of the front and of the rear hips.

    They lie at the height of the hips, as the origin of a robot's trunk does, so that
    the line between them is the trunk's x axis.

    Args:
        centre: of the trunk in m, shape (T, 3).
        hips: FL, FR, RL, RR in m, shape (T, 4, 3).
        half_size: x and y in m of the front left hip in the trunk's frame.
        path: the file, for the message.
        what: its format, for the message.

    Raises:
        InputError: if the hips are not those of that trunk.
    """
    x, y = half_size
    expected = np.array([[x, y], [x, -y], [-x, y], [-x, -y]])
    front, rear = hips[:, :2].mean(axis=1), hips[:, 2:].mean(axis=1)
    left, right = hips[:, ::2].mean(axis=1), hips[:, 1::2].mean(axis=1)
    axes = (front - rear) / (2 * x), (left - right) / (2 * y)
    rebuilt = centre[:, None] + sum(
        expected[:, k, None] * axis[:, None] for k, axis in enumerate(axes)
    )
    lengths = np.stack([np.linalg.norm(axis, axis=-1) for axis in axes])
    off = max(
        np.linalg.norm(rebuilt - hips, axis=-1).max(),
        (np.abs(lengths - 1) * np.array([[x], [y]])).max(),
    )
    if off > RIGID_WITHIN:
        raise InputError(
            f"{path} is not {what}: its hips do not lie {x} m ahead and behind, and "
            f"{y} m beside, the middle of a trunk (are these columns of another format,"
            " or not metres?)."
        )
    return front, rear
