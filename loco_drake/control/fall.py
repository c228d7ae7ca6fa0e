"""When a robot counts as fallen."""

import itertools

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_to_matrix
from loco_drake.control.state import HEIGHT, ORIENTATION
from loco_drake.models.robots import Robot

# Tilted this far from upright, a robot does not come back to its feet.
_MAX_TILT = np.deg2rad(60.0)
_CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


def has_fallen(
    robot: Robot, q: NDArray[np.float64], R_WB: NDArray[np.float64] | None = None
) -> NDArray[np.bool_]:
    """Returns whether the trunk's box touches the ground or leans over 60 degrees.

    Args:
        robot: the robot.
        q: the plant's positions, [R_WB as w x y z, p_WB, joints], shape (..., 19).
        R_WB: the base's rotation matrix (..., 3, 3), if it is known already.

    Returns:
        One bool for each robot, shape (...).
    """
    # The world's z axis in the trunk's frame.
    if R_WB is None:
        R_WB = quat_to_matrix(q[ORIENTATION])
    z_B = R_WB[..., 2, :]
    lowest = q[..., HEIGHT] + (z_B @ (_CORNERS * robot.trunk_size).T).min(axis=-1)
    return (lowest <= 0) | (z_B[..., 2] < np.cos(_MAX_TILT))
