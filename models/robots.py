"""Go2 and A1: their models as numbers."""

import re
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from pydrake.common.yaml import yaml_load
from pydrake.geometry import Box, SceneGraphInspector, Shape, Sphere
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Context, DiagramBuilder

from loco_drake.common.arrays import Array
from loco_drake.common.errors import check_choice

from .legs import LEGS
from .meshes import convert_meshes
from .quadruped import Quadruped

ROBOTS = ("go2", "a1")
LEG_JOINTS = ("hip", "thigh", "calf")

_MODELS = Path(__file__).parent


@dataclass(frozen=True, eq=False, kw_only=True)
class Robot(Quadruped):
    """A quadruped with three joints per leg, all read from its Drake model.

    Every leg has a hip (about x, abduction), a thigh and a calf (both about y), in this
    order. With the hip joint at p_BHip, the thigh joint at an offset ``d`` to its side,
    links of length ``l1`` and ``l2`` that hang down at zero, and angles a, b, c,

        p_BF = p_BHip + Rx(a) [-l1 sin b - l2 sin(b + c), d, -l1 cos b - l2 cos(b + c)]

    from which the kinematics follow in closed form.
    """

    url: str  # the model, package://...; see ConfigureParser
    effort_limits: Array  # at the joint, N m, shape (12,)
    reflected_inertia: Array  # of the rotors at the joint, kg m^2, shape (12,)
    # About each joint with the others locked in the standing pose, including reflected
    # inertia, kg m^2, shape (12,).
    joint_inertia: Array
    kp: Array  # stiffness of the motors' PD, N m/rad, shape (12,)
    # Damping of the motors' PD, N m s/rad, shape (12,). A plant's own is less, see
    # models.plant.plant_damping.
    kd: Array
    mass: float  # of the whole robot, kg
    # Y in m from the hip joint's axis to the thigh joint, positive on the left, shape
    # (4,).
    abduction_offset: Array
    thigh_length: float  # thigh joint to calf joint, m
    calf_length: float  # calf joint to the centre of the toe sphere, m
    # What all joints can lose at once while the mass matrix stays positive definite in
    # every pose, also with parameters.LEAST_PAYLOAD, kg m^2.
    removable_inertia: float
    trunk_size: Array  # of the trunk's collision box, centred at B, in m, shape (3,)

    @property
    def p_BV(self) -> Array:
        """The thigh joints at zero abduction, m, shape (4, 3)."""
        return self.p_BHip + self.abduction_offset[:, None] * np.array([0.0, 1.0, 0.0])

    @property
    def folded_length(self) -> float:
        """Distance of the toe from the thigh joint with the calf at its limit, m."""
        l1, l2 = self.thigh_length, self.calf_length
        square = l1**2 + l2**2 + 2 * l1 * l2 * np.cos(self.joint_lower[2])
        return float(np.sqrt(square))

    def AddModel(self, parser: Parser) -> ModelInstanceIndex:
        """Adds the model, without its meshes, to the parser's plant."""
        return AddRobotModel(parser, self.name, visual=False)

    def toe_positions(self, joints: Array) -> Array:
        """Returns p_BF in m, shape (..., 4, 3)."""
        return self._ends(joints, self.calf_length)

    def knee_positions(self, joints: Array) -> Array:
        """Returns the origins of the last joints in B, m, shape (..., 4, 3)."""
        return self._ends(joints, 0.0)

    def toe_jacobians(self, joints: Array) -> Array:
        """Returns d p_BF / d joints, m/rad, shape (..., 4, 3, n)."""
        a, b, c = _angles(joints)
        x2 = -self.calf_length * np.sin(b + c)
        z2 = -self.calf_length * np.cos(b + c)
        x = -self.thigh_length * np.sin(b) + x2
        z = -self.thigh_length * np.cos(b) + z2
        sin_a, cos_a = np.sin(a), np.cos(a)
        d = self.abduction_offset
        J = np.zeros((*a.shape, 3, 3))
        J[..., 1, 0] = -sin_a * d - cos_a * z
        J[..., 2, 0] = cos_a * d - sin_a * z
        # Turning about y by +db moves (x, z) by (z, -x) db.
        J[..., 0, 1] = z
        J[..., 1, 1] = sin_a * x
        J[..., 2, 1] = -cos_a * x
        J[..., 0, 2] = z2
        J[..., 1, 2] = sin_a * x2
        J[..., 2, 2] = -cos_a * x2
        return J

    def leg_joints(self, p_BF: Array) -> Array:
        """Returns joints (..., 12) in rad that put the toes at ``p_BF`` (..., 4, 3).

        Selects the solution with the foot below the hip's axis in the plane of the leg
        and the knee bent backward (calf negative), as these robots are built. A target
        out of the calf's range is clamped: the leg points at it with its largest or
        smallest length. Hip and thigh are not clamped, but within (-pi, pi].
        """
        x, y, z = np.moveaxis(p_BF - self.p_BHip, -1, 0)
        d, l1, l2 = self.abduction_offset, self.thigh_length, self.calf_length
        # Within the plane of the leg the toe is at (x, height).
        height = -np.sqrt(np.maximum(y * y + z * z - d * d, 0.0))
        a = np.arctan2(z, y) - np.arctan2(height, d)
        cos_c = (x * x + height * height - l1 * l1 - l2 * l2) / (2 * l1 * l2)
        c = -np.arccos(np.minimum(np.maximum(cos_c, -1.0), 1.0))
        c = np.minimum(np.maximum(c, self.joint_lower[2::3]), self.joint_upper[2::3])
        b = np.arctan2(-x, -height) - np.arctan2(l2 * np.sin(c), l1 + l2 * np.cos(c))
        joints = np.stack((_wrap(a), _wrap(b), c), axis=-1)
        return joints.reshape(*joints.shape[:-2], 12)

    def nearest_joints(self, p_BF: Array) -> Array:
        """Returns :meth:`leg_joints` clipped to the joint limits."""
        return np.clip(self.leg_joints(p_BF), self.joint_lower, self.joint_upper)

    def reachable_toes(self, p_BF: Array) -> Array:
        """Returns toe positions within the joint limits near ``p_BF``.

        A toe that is nearer to its hip than the leg folds is moved down the trunk's z
        axis. A leg that is too short points at its target.
        """
        x, y, z = np.moveaxis(p_BF - self.p_BHip, -1, 0)
        # In the plane of the leg, whose distance from the hip's axis is the offset.
        square = 1.001 * self.folded_length**2 + self.abduction_offset**2
        drop = np.sqrt(np.maximum(square - x**2 - y**2, 0.0))
        lowered = p_BF.copy()
        lowered[..., 2] = np.minimum(p_BF[..., 2], self.p_BHip[:, 2] - drop)
        folds = x**2 + y**2 + z**2 < square
        goal = np.where(folds[..., None], lowered, p_BF)
        return super().reachable_toes(goal)

    def _ends(self, joints: Array, calf_length: float) -> Array:
        """Returns points (..., 4, 3) in B at this distance below the calf joints."""
        a, b, c = _angles(joints)
        x = -self.thigh_length * np.sin(b) - calf_length * np.sin(b + c)
        z = -self.thigh_length * np.cos(b) - calf_length * np.cos(b + c)
        sin_a, cos_a = np.sin(a), np.cos(a)
        d = self.abduction_offset
        p_B = np.empty((*a.shape, 3))
        p_B[..., 0] = x
        p_B[..., 1] = cos_a * d - sin_a * z
        p_B[..., 2] = sin_a * d + cos_a * z
        p_B += self.p_BHip
        return p_B


def ConfigureParser(parser: Parser, *, visual: bool = True) -> None:
    """Registers the packages in the models' URLs with ``parser``.

    Those of the meshes are included if ``visual``; the first time this takes some
    seconds, see :mod:`loco_drake.models.meshes`.
    """
    parser.package_map().AddPackageXml(str(_MODELS / "package.xml"))
    if visual:
        parser.package_map().AddPackageXml(str(convert_meshes() / "package.xml"))


def AddRobotModel(parser: Parser, name: str, *, visual: bool) -> ModelInstanceIndex:
    """Adds one of :data:`ROBOTS` to the parser's plant, which is not finalized.

    Meshes are loaded if ``visual``. Without them parsing is five times as fast.

    Raises:
        InputError: if there is no such robot.
    """
    ConfigureParser(parser, visual=visual)
    url = _url(name)
    if visual:
        (instance,) = parser.AddModels(url=url)
        return instance
    text = Path(parser.package_map().ResolveUrl(url)).read_text()
    text = re.sub(r"<visual>.*?</visual>", "", text, flags=re.DOTALL)
    (instance,) = parser.AddModelsFromString(file_contents=text, file_type="urdf")
    return instance


@lru_cache
def get_robot(name: str) -> Robot:
    """Returns the robot ``name``; its model is parsed once.

    Raises:
        InputError: if there is no such robot.
    """
    url = _url(name)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.01)
    AddRobotModel(Parser(plant), name, visual=False)
    plant.Finalize()
    # The URDF lacks the standing pose, in rad, and the removable inertia.
    extras = yaml_load(filename=str(_MODELS / name / f"{name}.yaml"))
    names = tuple(f"{leg}_{part}_joint" for leg in LEGS for part in LEG_JOINTS)
    joints = [plant.GetJointByName(joint) for joint in names]
    actuators = [plant.GetJointActuatorByName(j.removesuffix("_joint")) for j in names]
    gains = [actuator.get_controller_gains() for actuator in actuators]

    # Lengths are those between frames of the model with all joints at zero.
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, [1.0, *[0.0] * (plant.num_positions() - 1)])
    p_BHip, p_BThigh, p_BCalf, p_BF = (
        _origins(plant, context, part) for part in (*LEG_JOINTS, "foot")
    )
    shape_of = partial(_collision_shape, plant, scene_graph.model_inspector())
    (foot_radius,) = {shape_of(f"{leg}_calf", Sphere).radius() for leg in LEGS}

    stand_joints = np.array(extras["stand_joints"], dtype=np.float64)
    plant.SetPositions(context, [1.0, *[0.0] * 6, *stand_joints])
    lowest = _origins(plant, context, "foot")[:, 2].min()
    joint_inertia = np.diag(plant.CalcMassMatrix(context))[6:]

    return Robot(
        name=name,
        definition=name,
        url=url,
        joint_names=names,
        joint_lower=np.concatenate([j.position_lower_limits() for j in joints]),
        joint_upper=np.concatenate([j.position_upper_limits() for j in joints]),
        joint_speed_limits=np.concatenate([j.velocity_upper_limits() for j in joints]),
        effort_limits=np.array([a.effort_limit() for a in actuators]),
        reflected_inertia=np.array(
            [a.default_rotor_inertia() * a.default_gear_ratio() ** 2 for a in actuators]
        ),
        joint_inertia=joint_inertia.copy(),
        kp=np.array([gain.p for gain in gains]),
        kd=np.array([gain.d for gain in gains]),
        removable_inertia=extras["removable_inertia"],
        mass=float(plant.CalcTotalMass(context)),
        p_BHip=p_BHip,
        abduction_offset=p_BThigh[:, 1] - p_BHip[:, 1],
        thigh_length=float(p_BThigh[0, 2] - p_BCalf[0, 2]),
        calf_length=float(p_BCalf[0, 2] - p_BF[0, 2]),
        foot_radius=foot_radius,
        trunk_size=np.array(shape_of("base", Box, centred=True).size()),
        stand_joints=stand_joints,
        stand_height=float(foot_radius - lowest),
        trunk_frame="base",
        foot_frames=tuple(f"{leg}_foot" for leg in LEGS),
    )


def _url(name: str) -> str:
    check_choice("robot", name, ROBOTS)
    return f"package://loco_drake_models/{name}/{name}.urdf"


def _origins(plant: MultibodyPlant, context: Context, part: str) -> Array:
    """Returns the origins in B of the four legs' frames ``part``, m, shape (4, 3)."""
    base = plant.GetFrameByName("base")
    frames = [plant.GetFrameByName(f"{leg}_{part}") for leg in LEGS]
    return np.array([frame.CalcPose(context, base).translation() for frame in frames])


def _collision_shape(
    plant: MultibodyPlant,
    inspector: SceneGraphInspector,
    body: str,
    kind: type[Shape],
    centred: bool = False,
) -> Shape:
    """Returns the only collision shape of a body, which must be of that kind."""
    (geometry,) = plant.GetCollisionGeometriesForBody(plant.GetBodyByName(body))
    shape = inspector.GetShape(geometry)
    assert isinstance(shape, kind)
    assert not centred or inspector.GetPoseInFrame(geometry).IsExactlyIdentity()
    return shape


def _angles(joints: Array) -> tuple[Array, Array, Array]:
    """Returns the hips', thighs' and calves' angles, each of shape (..., 4)."""
    return joints[..., 0::3], joints[..., 1::3], joints[..., 2::3]


def _wrap(angle: Array) -> Array:
    """Returns ``angle`` in rad, within (-pi, pi]; it must be within (-3 pi, 3 pi)."""
    turns = (angle <= -np.pi).astype(np.float64) - (angle > np.pi)
    return angle + 2 * np.pi * turns
