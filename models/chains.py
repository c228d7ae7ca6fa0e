"""A robot whose legs are chains of any revolute joints, as its URDF has them.

Its kinematics are those of :mod:`.chain_kinematics`. Toes are placed by Newton's
method, damped, within the joints' limits, all frames and legs at once; its curvature is
exact, so that a leg that is too short finds its best as fast.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_rotate

from .chain_kinematics import turn_chains
from .quadruped import Quadruped

_FOLD_SAMPLES = 1000
_MAX_ITERATIONS = 100
_FINE_STEP = 1e-10  # rad
# Damping in m^2: at first small against the square of a leg; a toe that even the last
# of it brings no nearer is as near as it gets.
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-10, 1e4
_SOFTER, _HARDER = 0.1, 10.0


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainRobot(Quadruped):
    """A quadruped of which the kinematics are known, and nothing else.

    It can be retargeted to; simulating it would take inertias, motors and contact.
    """

    model: str  # URDF text of links and joints alone
    # Unit vectors along the joints' axes in B, all joints at zero, (4, n, 3).
    axes: Array
    origins: Array  # a point on each axis in B, all joints at zero, m, shape (4, n, 3)
    toes: Array  # centres of the toe spheres in B, all joints at zero, m, shape (4, 3)

    @property
    def p_BV(self) -> Array:
        """Above the toes of the usual stance, as high as the hips."""
        p_BV = self.toe_positions(self.stand_joints)
        p_BV[:, 2] = self.p_BHip[:, 2]
        return p_BV

    @cached_property
    def folded_length(self) -> float:
        """Of the leg that folds least, from the last joint but one, by that joint."""
        lower, upper = _legs(self.joint_lower), _legs(self.joint_upper)
        low, high = np.maximum(lower[:, -1], -np.pi), np.minimum(upper[:, -1], np.pi)
        joints = np.zeros((_FOLD_SAMPLES, *lower.shape))
        joints[..., -1] = np.linspace(low, high, _FOLD_SAMPLES)
        toes, _, origins = self._forward(joints)
        hips = origins[..., max(0, lower.shape[1] - 2), :]
        return float(np.linalg.norm(toes - hips, axis=-1).min(axis=0).max())

    def AddModel(self, parser: Parser) -> ModelInstanceIndex:
        """Adds links and joints to the parser's plant."""
        (instance,) = parser.AddModelsFromString(self.model, "urdf")
        return instance

    def toe_positions(self, joints: Array) -> Array:
        """Returns p_BF in m, shape (..., 4, 3)."""
        return self._forward(_legs(joints))[0]

    def toe_jacobians(self, joints: Array) -> Array:
        """Returns d p_BF / d joints, m/rad, shape (..., 4, 3, n)."""
        toes, axes, origins = self._forward(_legs(joints))
        return _slopes(toes, axes, origins).swapaxes(-1, -2)

    def knee_positions(self, joints: Array) -> Array:
        """Returns the origins of the last joints in B, m, shape (..., 4, 3)."""
        origins: Array = self._forward(_legs(joints))[2][..., -1, :]
        return origins

    def nearest_joints(self, p_BF: Array) -> Array:
        """Returns joints that put the toes as near as can be, knees as in the stance.

        A leg without abduction leaves its toe at its own distance from the midline.
        """
        lower, upper = _legs(self.joint_lower), _legs(self.joint_upper)
        # Where the search begins decides how knees bend.
        joints = np.empty((*p_BF.shape[:-1], lower.shape[1]))
        joints[:] = _legs(self.stand_joints)
        damping = np.full(p_BF.shape[:-1], _FIRST_DAMPING)
        toes, axes, origins = self._forward(joints)
        for _ in range(_MAX_ITERATIONS):
            away = p_BF - toes
            rows = _slopes(toes, axes, origins)
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
            new = self._forward(tried)
            better = _squares(p_BF - new[0]) <= _squares(away)
            joints = np.where(better[..., None], tried, joints)
            toes = np.where(better[..., None], new[0], toes)
            axes = np.where(better[..., None, None], new[1], axes)
            origins = np.where(better[..., None, None], new[2], origins)
            damping = damping * np.where(better, _SOFTER, _HARDER)
            damping = damping.clip(_LEAST_DAMPING, _MOST_DAMPING)
            if ((moved < _FINE_STEP) | (damping >= _MOST_DAMPING)).all():
                break
        return joints.reshape(*joints.shape[:-2], len(self.joint_names))

    def _forward(self, joints: Array) -> tuple[Array, Array, Array]:
        """Returns toes (..., 4, 3), unit axes and origins (..., 4, n, 3), in B and m.

        Joints are in rad, shape (..., 4, n).
        """
        q, p, axes, origins = turn_chains(self.axes, self.origins, joints)
        toes = p + quat_rotate(q, self.toes)
        return toes, axes, origins


def _legs(joints: Array) -> Array:
    return joints.reshape(*joints.shape[:-1], 4, -1)


def _slopes(toes: Array, axes: Array, origins: Array) -> Array:
    """Returns the Jacobians' columns (..., n, 3): how a toe moves with each joint."""
    return np.cross(axes, toes[..., None, :] - origins)


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
