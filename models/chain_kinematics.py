"""Forward kinematics of chains of revolute joints, all chains and poses at once.

Each joint turns what lies beyond it about an axis that is known where all joints are
at zero: products of exponentials (Brockett 1984; Lynch and Park 2017, "Modern
Robotics", chapter 4).
"""

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_multiply, quat_rotate


def turn_chains(
    axes: Array, origins: Array, joints: Array
) -> tuple[Array, Array, Array, Array]:
    """Returns how C chains of n joints move what lies beyond their last joint.

    Args:
        axes: unit vectors along the joints' axes in B, all joints at zero, (C, n, 3).
        origins: a point on each axis there, m, shape (C, n, 3).
        joints: angles in rad, shape (..., C, n).

    Returns:
        Quaternion and translation, (..., C, 4) and (..., C, 3) in m, that take a point
        in B from where it is with all joints at zero; then the axes and the points on
        them, (..., C, n, 3).
    """
    half = joints[..., None] / 2
    turns = np.concatenate((np.cos(half), np.sin(half) * axes), axis=-1)
    q = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*joints.shape[:-1], 4))
    p = np.zeros((*joints.shape[:-1], 3))
    turned, moved = [], []
    for k in range(joints.shape[-1]):
        origin = origins[:, k]
        turned.append(quat_rotate(q, axes[:, k]))
        moved.append(p + quat_rotate(q, origin))
        q = quat_multiply(q, turns[..., k, :])
        p = moved[-1] - quat_rotate(q, origin)
    return q, p, np.stack(turned, axis=-2), np.stack(moved, axis=-2)
