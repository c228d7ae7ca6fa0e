"""A robot's model as MJCF, the XML of MuJoCo, from the numbers of its Drake model."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from pydrake.geometry import Box, GeometryId, SceneGraphInspector, Sphere
from pydrake.math import RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, RevoluteJoint, RigidBody
from pydrake.systems.framework import Context, DiagramBuilder

from loco_drake.common.gravity import GRAVITY

from .robots import Robot
from .xml_text import add_element

TIME_STEP = 0.002  # s
# Elliptic cones and stiff friction: otherwise feet creep in stance.
OPTIONS = {"integrator": "implicitfast", "cone": "elliptic", "impratio": 100.0}
# MuJoCo's impedance d of a contact, at any depth. The nearer it is to 1, the more the
# contact resists acceleration like a mass that the feet do not have.
_IMPEDANCE = 0.5


def robot_mjcf(robot: Robot, *, friction: float = 0.8) -> str:
    """Returns the model of ``robot`` on flat ground as MJCF.

    Bodies, inertias, joint limits, rotor inertias, effort limits and collision shapes
    are those of the Drake model; the robot does not touch itself. The actuators are
    the motors' PD with the gains robot.kp and robot.kd and take set-points in rad, in
    the order of the joints. The key frame "stand" is the standing pose.

    Contacts have the stiffness of the shape in N/m and, since MuJoCo's damping is
    linear, as much damping in N s/m as Hunt and Crossley's law has under the robot's
    weight. MuJoCo wants both per apparent mass of the body: with the inverse mass w
    that it computes at zero joint angles and its impedance d, solref is -(1 - d) w
    times stiffness and damping.

    Args:
        robot: the robot.
        friction: Coulomb coefficient of the ground; a contact has the harmonic mean of
            this and the shape's.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    writer = _Writer(robot, plant, scene_graph.model_inspector(), friction)
    root = writer.model()
    ET.indent(root)
    return f"{ET.tostring(root, encoding='unicode')}\n"


class _Writer:
    """Writes the elements of one robot's model."""

    def __init__(
        self,
        robot: Robot,
        plant: MultibodyPlant,
        inspector: SceneGraphInspector,
        friction: float,
    ) -> None:
        self._robot, self._plant, self._inspector = robot, plant, inspector
        self._friction = friction
        self._context = plant.CreateDefaultContext()
        zero = [1.0, *[0.0] * (plant.num_positions() - 1)]
        plant.SetPositions(self._context, zero)

    def model(self) -> ET.Element:
        robot = self._robot
        root = ET.Element("mujoco", model=robot.name)
        add_element(root, "compiler", angle="radian", inertiafromgeom="false")
        add_element(
            root, "option", timestep=TIME_STEP, gravity=[0, 0, -GRAVITY], **OPTIONS
        )
        world = add_element(root, "worldbody")
        # Bits of contype and conaffinity: all shapes touch the ground only.
        ground = {"type": "plane", "size": [0, 0, 1], "contype": 1, "conaffinity": 0}
        add_element(world, "geom", name="ground", **ground)
        height = [0.0, 0.0, robot.stand_height]
        base = self._body(world, robot.trunk_frame, height)
        add_element(base, "freejoint", name="base")
        self._inertia_and_shapes(base, robot.trunk_frame)
        bodies = {robot.trunk_frame: base}
        for name, armature in zip(
            robot.joint_names, robot.reflected_inertia, strict=True
        ):
            joint = self._plant.GetJointByName(name)
            parent = bodies[joint.parent_body().name()]
            bodies[joint.child_body().name()] = self._leg_body(parent, joint, armature)
        self._actuators(root)
        stand = [*height, 1.0, 0.0, 0.0, 0.0, *robot.stand_joints]
        key = add_element(root, "keyframe")
        add_element(key, "key", name="stand", qpos=stand, ctrl=robot.stand_joints)
        return root

    def _body(self, parent: ET.Element, name: str, position: Any) -> ET.Element:
        return add_element(parent, "body", name=name, pos=position)

    def _leg_body(
        self, parent: ET.Element, joint: RevoluteJoint, armature: float
    ) -> ET.Element:
        X_PJ = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        name = joint.child_body().name()
        body = self._body(parent, name, X_PJ.translation())
        limits = [*joint.position_lower_limits(), *joint.position_upper_limits()]
        add_element(
            body,
            "joint",
            name=joint.name(),
            axis=joint.revolute_axis(),
            range=limits,
            armature=armature,
        )
        self._inertia_and_shapes(body, name)
        return body

    def _inertia_and_shapes(self, element: ET.Element, name: str) -> None:
        body = self._plant.GetBodyByName(name)
        M_BBo = body.default_spatial_inertia()
        p_BoBcm = M_BBo.get_com()
        I_BBcm = M_BBo.Shift(p_BoBcm).CalcRotationalInertia()
        # Older versions of MuJoCo find the principal axes to seven digits only.
        moments, axes = np.linalg.eigh(I_BBcm.CopyToFullMatrix3())
        axes[:, 0] *= np.linalg.det(axes)
        add_element(
            element,
            "inertial",
            mass=M_BBo.get_mass(),
            pos=p_BoBcm,
            quat=RotationMatrix(axes).ToQuaternion().wxyz(),
            diaginertia=moments,
        )
        for shape in self._plant.GetCollisionGeometriesForBody(body):
            self._shape(element, body, shape)

    def _shape(
        self, element: ET.Element, body: RigidBody, geometry: GeometryId
    ) -> None:
        shape = self._inspector.GetShape(geometry)
        size: Any
        if isinstance(shape, Sphere):
            kind, size = "sphere", shape.radius()
        else:
            assert isinstance(shape, Box)
            kind, size = "box", shape.size() / 2
        material = {
            key: self._inspector.GetProximityProperties(geometry).GetProperty(
                "material", key
            )
            for key in (
                "coulomb_friction",
                "point_contact_stiffness",
                "hunt_crossley_dissipation",
            )
        }
        own = material["coulomb_friction"].dynamic_friction()
        stiffness = material["point_contact_stiffness"]
        weight = self._robot.mass * GRAVITY
        damping = material["hunt_crossley_dissipation"] * weight
        scale = (1 - _IMPEDANCE) * inverse_mass(self._plant, self._context, body)
        add_element(
            element,
            "geom",
            name=self._inspector.GetName(geometry).split("::")[-1],
            type=kind,
            size=size,
            pos=self._inspector.GetPoseInFrame(geometry).translation(),
            contype=0,
            conaffinity=1,
            # Of the two shapes in contact, the robot's parameters are used.
            priority=1,
            friction=[2 * own * self._friction / (own + self._friction), 0, 0],
            solref=[-scale * stiffness, -scale * damping],
            solimp=[_IMPEDANCE, _IMPEDANCE, 0.001, 0.5, 2.0],
        )

    def _actuators(self, root: ET.Element) -> None:
        robot = self._robot
        actuators = add_element(root, "actuator")
        for name, kp, kd, effort in zip(
            robot.joint_names, robot.kp, robot.kd, robot.effort_limits, strict=True
        ):
            add_element(
                actuators,
                "position",
                name=name.removesuffix("_joint"),
                joint=name,
                kp=kp,
                kv=kd,
                forcerange=[-effort, effort],
            )


def inverse_mass(plant: MultibodyPlant, context: Context, body: RigidBody) -> float:
    """Returns the mean inverse of the mass of a body's centre of mass, 1/kg.

    With J the Jacobian of the centre of mass and M the mass matrix, in the pose of
    ``context``: a third of the trace of J M^-1 J'.
    """
    W = plant.world_frame()
    J = plant.CalcJacobianTranslationalVelocity(
        context,
        JacobianWrtVariable.kV,
        body.body_frame(),
        body.default_com(),
        W,
        W,
    )
    M = plant.CalcMassMatrix(context)
    return float(np.trace(J @ np.linalg.solve(M, J.T))) / 3
