"""The interface of a robot to retargeting and metrics, for any leg design."""

from abc import abstractmethod
from dataclasses import dataclass

from loco_drake.common.arrays import Array

from .legged import LeggedRobot


@dataclass(frozen=True, eq=False, kw_only=True)
class Quadruped(LeggedRobot):
    """A robot with four legs of n joints each, J = 4 n in all, and four toe spheres.

    Joints are in the order of ``joint_names``: legs FL, FR, RL, RR, in a leg from the
    trunk to the toe.
    """

    p_BHip: Array  # origins of the legs' first joints in m, shape (4, 3)
    # Names of the frames at the centres of the toe spheres.
    foot_frames: tuple[str, ...]

    @property
    @abstractmethod
    def p_BV(self) -> Array:
        """Virtual hips in m, shape (4, 3): the points below which the toes stand."""

    @property
    @abstractmethod
    def folded_length(self) -> float:
        """Shortest distance of a toe from the joint that swings its leg fore-aft, m."""

    @abstractmethod
    def toe_jacobians(self, joints: Array) -> Array:
        """Returns d p_BF / d joints of each leg, m/rad, (..., 4, 3 rows x y z, n)."""

    @abstractmethod
    def knee_positions(self, joints: Array) -> Array:
        """Returns the origins of the legs' last joints in B, m, (..., 4, 3)."""

    @abstractmethod
    def nearest_joints(self, p_BF: Array) -> Array:
        """Returns joints (..., J) within the limits that put the toes near ``p_BF``."""

    def reachable_toes(self, p_BF: Array) -> Array:
        """Returns toe positions within the limits near ``p_BF``, shape (..., 4, 3)."""
        return self.toe_positions(self.nearest_joints(p_BF))
