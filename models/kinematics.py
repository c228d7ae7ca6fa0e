"""Forward and inverse kinematics of the legs, closed form and vectorised.

Every leg is a hip (about x), a thigh and a calf (both about y). With the hip joint at
p_BHip, the thigh joint ``d`` to its side, links of length ``l1`` and ``l2`` that hang
down at zero, and angles a, b, c,

    p_BF = p_BHip + Rx(a) [ -l1 sin b - l2 sin(b + c),  d,  -l1 cos b - l2 cos(b + c) ].

Arrays have any leading shape; legs are FL, FR, RL, RR.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # robots.py imports this module
    from .robots import Robot

Array = NDArray[np.float64]


def toe_positions(robot: "Robot", joints: Array) -> Array:
    """Returns the centres of the toe spheres.

    Args:
        robot: whose legs.
        joints: rad, shape (..., 12).

    Returns:
        p_BF in m, shape (..., 4, 3).
    """
    a, b, c = _split(joints)
    x = -robot.thigh_length * np.sin(b) - robot.calf_length * np.sin(b + c)
    z = -robot.thigh_length * np.cos(b) - robot.calf_length * np.cos(b + c)
    sin_a, cos_a = np.sin(a), np.cos(a)
    d = robot.abduction_offset
    p_BF = np.empty((*a.shape, 3))
    p_BF[..., 0] = x
    p_BF[..., 1] = cos_a * d - sin_a * z
    p_BF[..., 2] = sin_a * d + cos_a * z
    p_BF += robot.p_BHip
    return p_BF


def toe_jacobians(robot: "Robot", joints: Array) -> Array:
    """Returns each toe's Jacobian with respect to its own leg's joints.

    Args:
        robot: whose legs.
        joints: rad, shape (..., 12).

    Returns:
        d p_BF / d (hip, thigh, calf) in m/rad, shape (..., 4, 3, 3); rows are x, y, z.
    """
    a, b, c = _split(joints)
    x2 = -robot.calf_length * np.sin(b + c)
    z2 = -robot.calf_length * np.cos(b + c)
    x = -robot.thigh_length * np.sin(b) + x2
    z = -robot.thigh_length * np.cos(b) + z2
    sin_a, cos_a = np.sin(a), np.cos(a)
    d = robot.abduction_offset
    J = np.zeros((*a.shape, 3, 3))
    J[..., 1, 0] = -sin_a * d - cos_a * z
    J[..., 2, 0] = cos_a * d - sin_a * z
    # Turning about y by +db moves (x, z) by (z, -x) db.
    J[..., 0, 1] = z
    J[..., 1, 1] = sin_a * x
    J[..., 2, 1] = -cos_a * x
    J[..., 0, 2] = z2
    J[..., 1, 2] = sin_a * x2
    J[..., 2, 2] = -cos_a * x2
    return J


def leg_joints(robot: "Robot", p_BF: Array) -> Array:
    """Returns joints that put the toes at ``p_BF``.

    Of the solutions, this is the one with the foot below the hip's axis, in the plane
    of the leg, and the knee bent backward (calf negative), as these robots are built.
    A target that the calf's limits do not let the toe reach is clamped: the leg then
    points at it, as long (or short) as it can be. Hip and thigh are not clamped.

    Args:
        robot: whose legs.
        p_BF: centres of the toe spheres in m, shape (..., 4, 3).

    Returns:
        joints in rad, shape (..., 12); hip and thigh within (-pi, pi].
    """
    p = p_BF - robot.p_BHip
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    d, l1, l2 = robot.abduction_offset, robot.thigh_length, robot.calf_length
    # Within the plane of the leg the toe is at (x, height).
    height = -np.sqrt(np.maximum(y * y + z * z - d * d, 0.0))
    a = np.arctan2(z, y) - np.arctan2(height, d)
    cos_c = (x * x + height * height - l1 * l1 - l2 * l2) / (2 * l1 * l2)
    c = -np.arccos(np.minimum(np.maximum(cos_c, -1.0), 1.0))
    c = np.minimum(np.maximum(c, robot.joint_lower[2::3]), robot.joint_upper[2::3])
    b = np.arctan2(-x, -height) - np.arctan2(l2 * np.sin(c), l1 + l2 * np.cos(c))
    joints = np.stack((_wrap(a), _wrap(b), c), axis=-1)
    return joints.reshape(*joints.shape[:-2], 12)


def knee_positions(robot: "Robot", joints: Array) -> Array:
    """Returns the origins of the calf joints.

    Args:
        robot: whose legs.
        joints: rad, shape (..., 12).

    Returns:
        In B, m, shape (..., 4, 3).
    """
    a, b, _ = _split(joints)
    d, down = robot.abduction_offset, -robot.thigh_length * np.cos(b)
    p_BKnee: Array = robot.p_BHip + np.stack(
        (
            -robot.thigh_length * np.sin(b),
            np.cos(a) * d - np.sin(a) * down,
            np.sin(a) * d + np.cos(a) * down,
        ),
        axis=-1,
    )
    return p_BKnee


def folded_length(robot: "Robot") -> float:
    """Returns how near in m a toe can be to its thigh joint, the calf at its limit."""
    l1, l2 = robot.thigh_length, robot.calf_length
    square = l1**2 + l2**2 + 2 * l1 * l2 * np.cos(robot.joint_lower[2])
    return float(np.sqrt(square))


def reachable_toes(robot: "Robot", p_BF: Array) -> Array:
    """Returns where the joints' limits let the toes be, near ``p_BF``.

    A toe nearer to its hip than the leg folds is moved down the trunk's z axis. A leg
    that is too short points at its target.

    Args:
        robot: whose legs.
        p_BF: centres of the toe spheres in m, shape (..., 4, 3).

    Returns:
        In B, m, shape (..., 4, 3).
    """
    x, y, z = np.moveaxis(p_BF - robot.p_BHip, -1, 0)
    # In the plane of the leg, whose distance from the hip's axis is the offset.
    square = 1.001 * folded_length(robot) ** 2 + robot.abduction_offset**2
    drop = np.sqrt(np.maximum(square - x**2 - y**2, 0.0))
    lowered = p_BF.copy()
    lowered[..., 2] = np.minimum(p_BF[..., 2], robot.p_BHip[:, 2] - drop)
    folds = x**2 + y**2 + z**2 < square
    goal = np.where(folds[..., None], lowered, p_BF)
    return toe_positions(robot, robot.nearest_joints(goal))


def _split(joints: Array) -> tuple[Array, Array, Array]:
    """Returns the hips', thighs' and calves' angles, each of shape (..., 4)."""
    return joints[..., 0::3], joints[..., 1::3], joints[..., 2::3]


def _wrap(angle: Array) -> Array:
    """Returns ``angle`` in rad, within (-pi, pi]; it must be within (-3 pi, 3 pi)."""
    turns = (angle <= -np.pi).astype(np.float64) - (angle > np.pi)
    return angle + 2 * np.pi * turns
