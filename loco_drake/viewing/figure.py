"""A robot that is shown: its meshes, or sticks if it is known by a robot file alone."""

import numpy as np
from pydrake.geometry import Box, Capsule, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_multiply, quat_rotate
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION
from loco_drake.models.biped import Biped
from loco_drake.models.chains import ChainRobot
from loco_drake.models.legged import LeggedRobot
from loco_drake.models.legs import LEGS
from loco_drake.models.robot import Robot
from loco_drake.viewing.humanoid_figure import AddBody
from loco_drake.viewing.sticks import FOOT, LEFT, RIGHT, TRUNK, along

# m; where what is not shown is, under the floor.
AWAY = np.array([0.0, 0.0, -50.0])

# Over the height of the stance.
_TRUNK_HEIGHT = 0.2
_LINK_RADIUS = 0.04


def AddFigure(
    plant: MultibodyPlant, robot: LeggedRobot, prefix: str
) -> ModelInstanceIndex:
    """Adds a robot that can be seen to a plant that is not finalized.

    ``prefix`` tells it from others of its kind.
    """
    parser = Parser(plant, prefix)
    if isinstance(robot, Robot):
        return robot.AddModel(parser, visual=True)
    instance = robot.AddModel(parser)
    if isinstance(robot, Biped):
        AddBody(plant, robot, instance)
        return instance
    assert isinstance(robot, ChainRobot)
    _AddSticks(plant, robot, instance)
    return instance


class Figure:
    """Writes where a robot is into the positions of a finalized plant."""

    def __init__(
        self, plant: MultibodyPlant, robot: LeggedRobot, instance: ModelInstanceIndex
    ) -> None:
        trunk = plant.GetFrameByName(robot.trunk_frame, instance)
        floating = plant.GetFloatingBaseBodies()
        (root,) = (
            body
            for body in plant.GetBodiesWeldedTo(trunk.body())
            if body.index() in floating
        )
        X_BRoot = root.body_frame().CalcPose(plant.CreateDefaultContext(), trunk)
        self._p_BRoot = X_BRoot.translation()
        self._q_BRoot = X_BRoot.rotation().ToQuaternion().wxyz()
        self._start = root.floating_positions_start()
        joints = [plant.GetJointByName(name, instance) for name in robot.joint_names]
        self._joints = [joint.position_start() for joint in joints]

    def put(self, positions: Array, q: Array, middle: Array) -> None:
        """Writes into a plant's ``positions`` that the robot is at ``q`` - ``middle``.

        Args:
            positions: of the plant.
            q: [q_WB as w x y z, p_WB, joints], m and rad, shape (7 + J,).
            middle: what becomes the origin, m, shape (3,).
        """
        turn = q[ORIENTATION]
        place = q[POSITION] - middle + quat_rotate(turn, self._p_BRoot)
        positions[self._start : self._start + 4] = quat_multiply(turn, self._q_BRoot)
        positions[self._start + 4 : self._start + 7] = place
        positions[self._joints] = q[JOINTS]

    def hide(self, positions: Array) -> None:
        """Writes into a plant's ``positions`` that the robot is out of sight."""
        put_body(positions, self._start, AWAY)


def put_body(positions: Array, start: int, p_W: Array) -> None:
    """Writes that a body is at ``p_W``, not turned, its positions from ``start`` on."""
    positions[start : start + 7] = 1.0, 0.0, 0.0, 0.0, *p_W


def _AddSticks(
    plant: MultibodyPlant, robot: ChainRobot, instance: ModelInstanceIndex
) -> None:
    """Adds a box for the trunk, and for each leg a stick from joint to joint."""
    # The poses of links with all joints at zero are known in a finalized plant only.
    model = MultibodyPlant(time_step=0.0)
    robot.AddModel(Parser(model))
    model.Finalize()
    context = model.CreateDefaultContext()
    B = model.GetFrameByName(robot.trunk_frame)

    def pose(body: RigidBody) -> RigidTransform:
        """Returns the pose of B in the body, all joints at zero."""
        return B.CalcPose(context, model.GetBodyByName(body.name()).body_frame())

    trunk = plant.GetFrameByName(robot.trunk_frame, instance).body()
    low, high = robot.p_BHip.min(axis=0), robot.p_BHip.max(axis=0)
    size = np.append((high - low)[:2], _TRUNK_HEIGHT * robot.stand_height)
    # Hips in one plane, as of a planar robot, have a trunk between them all the same.
    box = Box(*np.maximum(size, size[2]))
    X_LG = pose(trunk) @ RigidTransform((low + high) / 2)
    plant.RegisterVisualGeometry(trunk, X_LG, box, "trunk", TRUNK.rgba)
    radius = _LINK_RADIUS * robot.stand_height
    count = len(robot.joint_names) // len(LEGS)
    for leg, name in enumerate(LEGS):
        ends = [*robot.origins[leg], robot.toes[leg]]
        color = LEFT if name[1] == "L" else RIGHT
        for k in range(count):
            joint = plant.GetJointByName(robot.joint_names[leg * count + k], instance)
            link = joint.child_body()
            X_LB = pose(link)
            stick = f"{name}_stick{k}"
            length = float(np.linalg.norm(ends[k + 1] - ends[k]))
            X_LG = X_LB @ along(ends[k], ends[k + 1])
            shape = Capsule(radius, length) if length > radius else Sphere(radius)
            plant.RegisterVisualGeometry(link, X_LG, shape, stick, color.rgba)
        toe = Sphere(robot.foot_radius)
        X_LG = X_LB @ RigidTransform(robot.toes[leg])
        plant.RegisterVisualGeometry(link, X_LG, toe, f"{name}_toe", FOOT.rgba)
