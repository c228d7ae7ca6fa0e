"""A robot whose kinematics are those of any URDF with four legs."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from .chains import LegChains
from .quadruped import Quadruped

Array = NDArray[np.float64]

_FOLD_SAMPLES = 1000


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainRobot(Quadruped):
    """A quadruped of which the kinematics are known, and nothing else.

    It can be retargeted to; simulating it would take inertias, motors and contact.

    Attributes:
        model: URDF text of links and joints alone.
        chains: its legs.
    """

    model: str
    chains: LegChains

    @property
    def p_BV(self) -> Array:
        """Above the toes of the usual stance, as high as the hips."""
        p_BV = self.toe_positions(self.stand_joints)
        p_BV[:, 2] = self.p_BHip[:, 2]
        return p_BV

    @cached_property
    def folded_length(self) -> float:
        """Of the leg that folds least, from the last joint but one, by that joint."""
        lower, upper = self._legs(self.joint_lower), self._legs(self.joint_upper)
        low, high = np.maximum(lower[:, -1], -np.pi), np.minimum(upper[:, -1], np.pi)
        joints = np.zeros((_FOLD_SAMPLES, *lower.shape))
        joints[..., -1] = np.linspace(low, high, _FOLD_SAMPLES)
        toes, _, origins = self.chains.forward(joints)
        hips = origins[..., max(0, lower.shape[1] - 2), :]
        return float(np.linalg.norm(toes - hips, axis=-1).min(axis=0).max())

    def AddModel(self, parser: Parser) -> ModelInstanceIndex:
        """Adds links and joints to the parser's plant."""
        (instance,) = parser.AddModelsFromString(self.model, "urdf")
        return instance

    def toe_positions(self, joints: Array) -> Array:
        """Returns p_BF in m, shape (..., 4, 3)."""
        return self.chains.forward(self._legs(joints))[0]

    def knee_positions(self, joints: Array) -> Array:
        """Returns the origins of the last joints in B, m, shape (..., 4, 3)."""
        origins: Array = self.chains.forward(self._legs(joints))[2][..., -1, :]
        return origins

    def nearest_joints(self, p_BF: Array) -> Array:
        """Returns joints that put the toes as near as can be, knees as in the stance.

        A leg without abduction leaves its toe at its own distance from the midline.
        """
        vectors = (self.stand_joints, self.joint_lower, self.joint_upper)
        joints = self.chains.nearest(p_BF, *map(self._legs, vectors))
        return joints.reshape(*joints.shape[:-2], len(self.joint_names))

    def reachable_toes(self, p_BF: Array) -> Array:
        """Returns the places that are nearest to ``p_BF``."""
        return self.toe_positions(self.nearest_joints(p_BF))

    def _legs(self, joints: Array) -> Array:
        return joints.reshape(*joints.shape[:-1], 4, -1)
