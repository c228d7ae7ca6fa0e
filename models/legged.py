"""What is common to robots on any number of legs, for metrics and pictures."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LeggedRobot(ABC):
    """A robot that stands on spheres, all of one radius, at the ends of its legs.

    Arrays are read-only float64. B is the trunk frame: x forward, y left, z up. Methods
    take and return arrays with any leading shape.
    """

    name: str  # name in Motion files
    definition: str  # argument of models.robots.load_robot
    joint_names: tuple[str, ...]  # names of the J joints
    joint_lower: Array  # lower position limits in rad, shape (J,)
    joint_upper: Array  # upper position limits in rad, shape (J,)
    joint_speed_limits: Array  # rad/s, shape (J,)
    foot_radius: float  # radius of the spheres, m
    stand_joints: Array  # joints of the standing pose in rad, shape (J,)
    # Z of p_WB in m with the trunk level, the joints at stand_joints and the lowest
    # points of the spheres at z = 0.
    stand_height: float
    trunk_frame: str  # name of B in the model

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @abstractmethod
    def AddModel(self, parser: Parser) -> ModelInstanceIndex:
        """Adds the model, without visual geometry, to the parser's plant."""

    @abstractmethod
    def toe_positions(self, joints: Array) -> Array:
        """Returns p_BF in m, the centres of the N spheres, (..., N, 3)."""
