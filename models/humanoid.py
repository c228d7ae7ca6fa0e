"""A humanoid that can be simulated."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.rotations import quat_rotate

from .biped import Biped
from .chain_kinematics import turn_chains
from .parsing import AddUrdf
from .simulated import SimulatedRobot


@dataclass(frozen=True, eq=False, kw_only=True)
class Humanoid(Biped, SimulatedRobot):
    """A biped with masses, motors and soles that touch the ground.

    The four points that it stands on are the ends of the soles, see
    :meth:`contact_points`; the plant touches the ground with the eight spheres there.
    """

    simulation: str  # text of the URDF with inertias, motors and soles
    # Of the legs' joints, in B with all joints at zero: unit vectors along their axes,
    # and a point on each, m, shape (2, n, 3).
    leg_axes: Array
    leg_origins: Array
    # Heels and toes there, m, shape (2 legs, 2 ends, 3); toes first.
    sole_origins: Array

    def AddModel(self, parser: Parser, *, visual: bool = False) -> ModelInstanceIndex:
        """Adds the model, by default without what is only seen, to a plant."""
        return AddUrdf(parser, model=self.simulation, visual=visual)

    @property
    def contact_joints(self) -> Integers:
        """Those of the left, the right, the left and the right leg, shape (4, n)."""
        legs = np.arange(self.leg_joints).reshape(2, -1)
        return legs[[0, 1, 0, 1]]

    def contact_points(self, joints: Array) -> Array:
        """Returns toes left and right, heels left and right in B, m, (..., 4, 3).

        As :meth:`sole_ends`, in closed form.
        """
        return self._forward(joints)[0]

    def contact_jacobians(self, joints: Array) -> Array:
        """Returns d p_BF / d joints, m/rad, (..., 4, 3, n)."""
        points, axes, origins = self._forward(joints)
        legs = [0, 1, 0, 1]
        arms = points[..., None, :] - origins[..., legs, :, :]
        return np.cross(axes[..., legs, :, :], arms).swapaxes(-1, -2)

    def _forward(self, joints: Array) -> tuple[Array, Array, Array]:
        """Returns the points (..., 4, 3), and axes and origins (..., 2, n, 3)."""
        legs = joints[..., : self.leg_joints].reshape(*joints.shape[:-1], 2, -1)
        q, p, axes, origins = turn_chains(self.leg_axes, self.leg_origins, legs)
        ends = p[..., None, :] + quat_rotate(q[..., None, :], self.sole_origins)
        # From leg and end to end and leg.
        points = ends.swapaxes(-2, -3).reshape(*joints.shape[:-1], 4, 3)
        return points, axes, origins
