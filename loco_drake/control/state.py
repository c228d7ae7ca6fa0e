"""A robot's state [q, v]: its parts, its unit quaternion, and whether it has fallen.

The order is that of the plant: q = [q_WB as w x y z, p_WB, joints], of size 7 + J, and
v = [w_WB_W, v_WB_W, joint velocities], of size 6 + J. ``q[JOINTS]`` and the like take
arrays of any leading shape, which Drake's namedview does not.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_to_matrix
from loco_drake.models.robots import Robot

Array = NDArray[np.float64]

# Of q.
ORIENTATION = np.s_[..., :4]
POSITION = np.s_[..., 4:7]
JOINTS = np.s_[..., 7:]
HEIGHT = 6
# Of v.
ANGULAR_VELOCITY = np.s_[..., :3]
VELOCITY = np.s_[..., 3:6]
JOINT_VELOCITIES = np.s_[..., 6:]

_ROUNDING = (
    1e-14  # what dividing a quaternion by its length leaves of the square's error
)
# Tilted this far from upright, a robot does not come back to its feet.
_MAX_TILT = np.deg2rad(60.0)
_CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


def split(state: Array) -> tuple[Array, Array]:
    """Returns views of q, shape (..., 7 + J), and v, shape (..., 6 + J)."""
    positions = (state.shape[-1] + 1) // 2
    return state[..., :positions], state[..., positions:]


def unit_base(state: Array) -> Array:
    """Returns states, or positions, whose quaternion of the base has length one.

    Drake's discrete plants integrate the quaternion and never normalize it: its length
    grows by a few per cent in ten seconds of a trot. The plant itself does not mind.
    What is one up to rounding stays as it is, so that doing it twice is doing it once.

    Args:
        state: [q, v] or q, shape (..., n).
    """
    w, x, y, z = (state[..., i] for i in range(4))
    square = w * w + x * x + y * y + z * z
    off = np.abs(square - 1) > _ROUNDING
    if not off.any():
        return state
    result = state.copy()
    result[ORIENTATION] *= np.where(off, 1 / np.sqrt(square), 1.0)[..., None]
    return result


def has_fallen(robot: Robot, q: Array, R_WB: Array | None = None) -> NDArray[np.bool_]:
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
