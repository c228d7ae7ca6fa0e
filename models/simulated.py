"""What simulation and control know of a robot, on any number of legs."""

from abc import abstractmethod
from dataclasses import dataclass, field
from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from loco_drake.common.arrays import Array, Integers

from .legged import LeggedRobot
from .legs import MIRROR_JOINT_SIGNS, MIRROR_JOINTS


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedRobot(LeggedRobot):
    """A robot with masses and motors, which stands on four points.

    The points are those of a plan's ``p_WF`` and ``contacts``: the four toes of a
    quadruped; toes left and right and heels left and right of a humanoid.
    """

    effort_limits: Array  # at the joint, N m, shape (J,)
    reflected_inertia: Array  # of the rotors at the joint, kg m^2, shape (J,)
    # About each joint with the others locked in the standing pose, including reflected
    # inertia, kg m^2, shape (J,).
    joint_inertia: Array
    kp: Array  # stiffness of the motors' PD, N m/rad, shape (J,)
    # Damping of the motors' PD, N m s/rad, shape (J,). A plant's own is less, see
    # models.plant.plant_damping.
    kd: Array
    mass: float  # of the whole robot, kg
    # Of the box, centred at B, that touches the ground only after a fall, m, shape
    # (3,).
    trunk_size: Array
    # How joints are mirrored left-right: the joint whose mirror image each one is, and
    # the sign of its angle there, shape (J,) each.
    mirror_joints: Integers = field(default_factory=MIRROR_JOINTS.copy)
    mirror_joint_signs: Array = field(default_factory=MIRROR_JOINT_SIGNS.copy)
    weights: Path | None = None  # folder of its own networks, or None

    @abstractmethod
    def AddModel(self, parser: Parser, *, visual: bool = False) -> ModelInstanceIndex:
        """Adds the model, by default without its meshes, to the parser's plant."""

    @property
    @abstractmethod
    def contact_joints(self) -> Integers:
        """Numbers of the joints that move each of the four points, shape (4, n)."""

    @abstractmethod
    def contact_points(self, joints: Array) -> Array:
        """Returns p_BF in m, the four points, shape (..., 4, 3)."""

    @abstractmethod
    def contact_jacobians(self, joints: Array) -> Array:
        """Returns d p_BF / d joints, m/rad, (..., 4, 3 rows x y z, n).

        The columns are those of :attr:`contact_joints`.
        """
