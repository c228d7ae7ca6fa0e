"""The interface of a robot to retargeting and metrics, for any leg design."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Quadruped(ABC):
    """A robot with four legs of n joints each, J = 4 n in all.

    Arrays are read-only float64. Joints are in the order of ``joint_names``: legs FL,
    FR, RL, RR, in a leg from the trunk to the toe. B is the trunk frame: x forward, y
    left, z up. Methods take and return arrays with any leading shape.
    """

    name: str  # name in Motion files
    definition: str  # argument of models.robots.load_robot
    joint_names: tuple[str, ...]  # names of the J joints
    joint_lower: Array  # lower position limits in rad, shape (J,)
    joint_upper: Array  # upper position limits in rad, shape (J,)
    joint_speed_limits: Array  # rad/s, shape (J,)
    p_BHip: Array  # origins of the legs' first joints in m, shape (4, 3)
    foot_radius: float  # radius of the toe spheres, m
    stand_joints: Array  # joints of the standing pose in rad, shape (J,)
    # Z of p_WB in m with the trunk level, the joints at stand_joints and the lowest
    # points of the toe spheres at z = 0.
    stand_height: float
    trunk_frame: str  # name of B in the model
    # Names of the frames at the centres of the toe spheres.
    foot_frames: tuple[str, ...]

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    @abstractmethod
    def p_BV(self) -> Array:
        """Virtual hips in m, shape (4, 3): the points below which the toes stand."""

    @property
    @abstractmethod
    def folded_length(self) -> float:
        """Shortest distance of a toe from the joint that swings its leg fore-aft, m."""

    @abstractmethod
    def AddModel(self, parser: Parser) -> ModelInstanceIndex:
        """Adds the model, without visual geometry, to the parser's plant."""

    @abstractmethod
    def toe_positions(self, joints: Array) -> Array:
        """Returns p_BF in m, the centres of the toe spheres, (..., 4, 3)."""

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
