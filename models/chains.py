"""Kinematics of legs of any revolute joints, by products of exponentials.

Each joint turns what lies beyond it about an axis that is known where all joints are
at zero (Brockett 1984; Lynch and Park 2017, "Modern Robotics", chapter 4). Toes are
placed by Newton's method, damped, within the joints' limits, all frames and legs at
once; its curvature is exact, so that a leg that is too short finds its best as fast.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_multiply, quat_rotate

Array = NDArray[np.float64]

_MAX_ITERATIONS = 100
_FINE_STEP = 1e-10  # rad
# Damping in m^2: at first small against the square of a leg; a toe that even the last
# of it brings no nearer is as near as it gets.
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-10, 1e4
_SOFTER, _HARDER = 0.1, 10.0


@dataclass(frozen=True, eq=False)
class LegChains:
    """Four legs of n revolute joints each, described where all joints are at zero.

    Attributes:
        axes: unit vectors along the joints' axes in B, shape (4, n, 3).
        origins: a point on each axis in B, m, shape (4, n, 3).
        toes: centres of the toe spheres in B, m, shape (4, 3).
    """

    axes: Array
    origins: Array
    toes: Array

    def forward(self, joints: Array) -> tuple[Array, Array, Array]:
        """Returns toes, axes and origins where the joints are at ``joints``.

        Args:
            joints: rad, shape (..., 4, n).

        Returns:
            In B: toes (..., 4, 3) in m, unit axes (..., 4, n, 3), origins of the same
            shape in m.
        """
        half = joints[..., None] / 2
        turns = np.concatenate((np.cos(half), np.sin(half) * self.axes), axis=-1)
        q = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*joints.shape[:-1], 4))
        p = np.zeros((*joints.shape[:-1], 3))
        axes, origins = [], []
        for k in range(joints.shape[-1]):
            origin = self.origins[:, k]
            axes.append(quat_rotate(q, self.axes[:, k]))
            origins.append(p + quat_rotate(q, origin))
            q = quat_multiply(q, turns[..., k, :])
            p = origins[-1] - quat_rotate(q, origin)
        toes = p + quat_rotate(q, self.toes)
        return toes, np.stack(axes, axis=-2), np.stack(origins, axis=-2)

    def nearest(self, p_BF: Array, start: Array, lower: Array, upper: Array) -> Array:
        """Returns joints within limits that put each toe as near to ``p_BF`` as can be.

        Args:
            p_BF: in m, shape (..., 4, 3).
            start: where the search begins, which decides how knees bend, (4, n).
            lower: rad, shape (4, n).
            upper: rad, shape (4, n).

        Returns:
            rad, shape (..., 4, n).
        """
        joints = np.broadcast_to(start, (*p_BF.shape[:-1], start.shape[-1])).copy()
        damping = np.full(p_BF.shape[:-1], _FIRST_DAMPING)
        toes, axes, origins = self.forward(joints)
        for _ in range(_MAX_ITERATIONS):
            away = p_BF - toes
            # Row k: how the toe moves with joint k.
            rows = np.cross(axes, toes[..., None, :] - origins)
            slope = (rows @ away[..., None])[..., 0]
            stuck = (joints <= lower) & (slope < 0) | (joints >= upper) & (slope > 0)
            free = ~stuck
            slope = free * slope
            curvature = (
                _curvature(rows, axes, away) * free[..., None] * free[..., None, :]
            )
            # Where it is negative, downhill is the way all the same.
            values, vectors = np.linalg.eigh(curvature)
            stiffness = np.abs(values) + damping[..., None]
            along = (slope[..., None, :] @ vectors)[..., 0, :] / stiffness
            step = free * (vectors @ along[..., None])[..., 0]
            tried = np.clip(joints + step, lower, upper)
            moved = np.abs(tried - joints).max(axis=-1)
            new = self.forward(tried)
            better = _squares(p_BF - new[0]) <= _squares(away)
            joints = np.where(better[..., None], tried, joints)
            toes = np.where(better[..., None], new[0], toes)
            axes = np.where(better[..., None, None], new[1], axes)
            origins = np.where(better[..., None, None], new[2], origins)
            damping = np.clip(
                np.where(better, _SOFTER, _HARDER) * damping,
                _LEAST_DAMPING,
                _MOST_DAMPING,
            )
            if ((moved < _FINE_STEP) | (damping >= _MOST_DAMPING)).all():
                break
        return joints


def _curvature(rows: Array, axes: Array, away: Array) -> Array:
    """Returns the second derivatives of half the squared distance, (..., n, n).

    A toe's own are a_i x (a_j x p) of joint i and one, j, beyond it.
    """
    bend = np.cross(axes[..., :, None, :], rows[..., None, :, :])
    second = np.triu((bend @ away[..., None, :, None])[..., 0])
    second = second + np.triu(second, 1).swapaxes(-1, -2)
    curvature: Array = rows @ rows.swapaxes(-1, -2) - second
    return curvature


def _squares(vectors: Array) -> Array:
    return (vectors * vectors).sum(axis=-1)
