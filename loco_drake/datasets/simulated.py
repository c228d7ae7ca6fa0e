"""Reader for the two simulated robots.

A file has 27 columns and no header: 9 points x (x, y, z) in metres, z up: the centre of
the trunk, four hips and four feet, in an order that depends on the source.
"""

from pathlib import Path

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.datasets.recording import read_table

# Rounding of the text and slack of the simulated joints, m.
RIGID_WITHIN = 0.005


def read_robot(
    path: Path, half_size: tuple[float, float], centre: int, hips: int, feet: int
) -> Array:
    """Returns the points of a file: withers, hip, feet FL, FR, RL, RR, (T, 6, 3) in m.

    Withers and hip are the midpoints of the front and rear hips. They are at the height
    of the hips, like the origin of a robot's trunk, so the line between them is the
    trunk's x axis.

    Args:
        path: the file.
        half_size: x and y in m of the front left hip in the trunk's frame.
        centre: which of the nine points the trunk's centre is.
        hips: the first of the hips FL, FR, RL, RR.
        feet: the first of the feet.

    Raises:
        InputError: if the file has another form, or other hips than such a trunk.
    """
    points = read_table(path, 27).reshape(-1, 9, 3)
    p_hips = points[:, hips : hips + 4]
    x, y = half_size
    front, rear = p_hips[:, :2].mean(axis=1), p_hips[:, 2:].mean(axis=1)
    left, right = p_hips[:, ::2].mean(axis=1), p_hips[:, 1::2].mean(axis=1)
    axes = np.stack(((front - rear) / (2 * x), (left - right) / (2 * y)), axis=1)
    expected = np.array([[x, y], [x, -y], [-x, y], [-x, -y]])
    rebuilt = points[:, None, centre] + expected @ axes
    lengths = np.linalg.norm(axes, axis=-1)
    off = np.maximum(
        np.linalg.norm(rebuilt - p_hips, axis=-1).max(axis=-1),
        (np.abs(lengths - 1) * half_size).max(axis=-1),
    )
    if (off > RIGID_WITHIN).any():
        line = int(np.argmax(off > RIGID_WITHIN)) + 1
        raise InputError(
            f"in line {line} its hips do not lie {x} m ahead and behind, and {y} m "
            "beside, the middle of a trunk (are these columns of another format, or "
            "not metres?)."
        )
    return np.stack((front, rear, *np.moveaxis(points[:, feet : feet + 4], 1, 0)), 1)
