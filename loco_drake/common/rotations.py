"""Vectorized rotations in NumPy; quaternions are (w, x, y, z), as in Drake.

All functions accept arrays of any leading shape. The tests compare them with SciPy.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def quat_multiply(a: Array, b: Array) -> Array:
    """Returns the Hamilton product a·b; shapes (..., 4) broadcast."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    w = aw * bw - ax * bx - ay * by - az * bz
    product = np.empty((*w.shape, 4))
    product[..., 0] = w
    product[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def quat_conjugate(q: Array) -> Array:
    """Returns the inverse of unit quaternions, shape (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def quat_rotate(q_AB: Array, p_B: Array) -> Array:
    """Returns p_A = R_AB p_B; q is (..., 4), p is (..., 3)."""
    w = q_AB[..., :1]
    xyz = q_AB[..., 1:]
    t = 2.0 * _cross(xyz, p_B)
    return p_B + w * t + _cross(xyz, t)


def _cross(a: Array, b: Array) -> Array:
    # np.cross is ten times slower on single vectors.
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-1)


def quat_to_matrix(q: Array) -> Array:
    """Returns rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz = x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    # Filled in place: np.stack takes as long as all the products.
    R = np.empty((*q.shape[:-1], 3, 3))
    R[..., 0, 0] = 1 - 2 * (yy + zz)
    R[..., 0, 1] = 2 * (xy - wz)
    R[..., 0, 2] = 2 * (xz + wy)
    R[..., 1, 0] = 2 * (xy + wz)
    R[..., 1, 1] = 1 - 2 * (xx + zz)
    R[..., 1, 2] = 2 * (yz - wx)
    R[..., 2, 0] = 2 * (xz - wy)
    R[..., 2, 1] = 2 * (yz + wx)
    R[..., 2, 2] = 1 - 2 * (xx + yy)
    return R


def heading_matrix(R_WB: Array) -> Array:
    """Returns R_WH (..., 3, 3), where H has the body's heading and z up.

    Row vectors in W times R_WH are the same vectors expressed in H.
    """
    x, y = R_WB[..., 0, 0], R_WB[..., 1, 0]
    length = np.hypot(x, y)
    upright = length > 1e-9  # else the body points straight up or down
    cos = np.divide(x, length, out=np.ones_like(x), where=upright)
    sin = np.divide(y, length, out=np.zeros_like(y), where=upright)
    R_WH = np.zeros_like(R_WB)
    R_WH[..., 0, 0] = R_WH[..., 1, 1] = cos
    R_WH[..., 1, 0], R_WH[..., 0, 1] = sin, -sin
    R_WH[..., 2, 2] = 1.0
    return R_WH


def quat_log(q: Array) -> Array:
    """Returns rotation vectors (..., 3) in so(3), with a norm of at most pi."""
    q = np.where(q[..., :1] < 0, -q, q)
    xyz = q[..., 1:]
    norm = np.sqrt((xyz * xyz).sum(axis=-1, keepdims=True))
    angle = 2.0 * np.arctan2(norm, q[..., :1])
    # angle / sin(angle / 2) tends to 2 as the angle vanishes.
    scale = np.divide(angle, norm, out=np.full_like(norm, 2.0), where=norm > 1e-9)
    return xyz * scale


def quat_exp(rotation: Array) -> Array:
    """Returns unit quaternions (..., 4) of rotation vectors (..., 3)."""
    half = 0.5 * np.sqrt((rotation * rotation).sum(axis=-1, keepdims=True))
    # sin(h) / h by numpy's normalised sinc, which is exact at zero.
    return np.concatenate(
        (np.cos(half), 0.5 * np.sinc(half / np.pi) * rotation), axis=-1
    )


def quat_error(q_WA: Array, q_WB: Array) -> Array:
    """Returns the rotation vector from A to B, expressed in W, shape (..., 3)."""
    return quat_log(quat_multiply(q_WB, quat_conjugate(q_WA)))


def yaw_of(q: Array) -> Array:
    """Returns the heading of the body's x axis in rad, shape (...)."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def yaw_quat(yaw: Array) -> Array:
    """Returns quaternions (..., 4) of rotations by ``yaw`` rad about z."""
    yaw = np.asarray(yaw, dtype=np.float64)
    zero = np.zeros_like(yaw)
    return np.stack((np.cos(yaw / 2), zero, zero, np.sin(yaw / 2)), axis=-1)


def rotate_plane(vectors: Array, angles: Array) -> Array:
    """Returns plane vectors (..., 2) turned by ``angles`` (...) rad."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1)


def quat_continuous(q: Array) -> Array:
    """Returns a sequence (T, 4) with signs flipped so that neighbours agree."""
    dots = (q[1:] * q[:-1]).sum(axis=-1)
    signs = np.concatenate(([1.0], np.cumprod(np.where(dots < 0, -1.0, 1.0))))
    return q * signs[:, None]


def angular_velocity(q: Array, dt: float) -> Array:
    """Returns w_WB_W (T, 3) in rad/s of a sequence (T, 4), by central differences."""
    steps = quat_error(q[:-1], q[1:]) / dt
    inner = quat_error(q[:-2], q[2:]) / (2 * dt)
    return np.concatenate((steps[:1], inner, steps[-1:]))
