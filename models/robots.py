"""Robots by name or by file; Go2 and A1 are read here."""

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
from loco_drake.common.errors import InputError, check_choice, quoted

from .biped_file import BIPEDS, is_biped_file, read_biped
from .humanoids import humanoid_settings, read_humanoid
from .legged import LeggedRobot
from .legs import LEGS
from .own_robots import Setting, read_own_robot
from .parsing import AddUrdf
from .parsing import ConfigureParser as ConfigureParser
from .quadruped import Quadruped
from .robot import LEAST_PAYLOAD
from .robot import ROBOTS as ROBOTS
from .robot import Robot as Robot
from .robot_files import is_robot_file, read_robot
from .simulated import SimulatedRobot as SimulatedRobot

LEG_JOINTS = ("hip", "thigh", "calf")

_MODELS = Path(__file__).parent
# Robots that were read from files in this process, by their names.
_READ: dict[str, Robot] = {}


def AddRobotModel(parser: Parser, name: str, *, visual: bool) -> ModelInstanceIndex:
    """Adds one of :data:`ROBOTS` to the parser's plant, which is not finalized.

    Meshes are loaded if ``visual``. Without them parsing is five times as fast.

    Raises:
        InputError: if there is no such robot.
    """
    return AddUrdf(parser, url=_url(name), visual=visual)


def get_robot(definition: str) -> Robot:
    """Returns a robot that can be simulated; its model is parsed once.

    Args:
        definition: one of :data:`ROBOTS`, a robot's YAML file, or the name of a robot
            that this process has read from its file before.

    Raises:
        InputError: if there is no such robot, or the file or its URDF will not do.
    """
    if is_robot_file(definition):
        robot, _ = _read_file(Path(definition).resolve())
        _READ[robot.name] = robot
        return robot
    if definition in _READ:
        return _READ[definition]
    if definition not in ROBOTS:
        raise InputError(
            f"Unknown robot {quoted(definition)}; the choices are "
            f"{', '.join(ROBOTS)}, or a robot's YAML file."
        )
    return _read_shipped(definition)


def get_simulated(definition: str) -> SimulatedRobot:
    """Returns a robot that can be simulated: as :func:`get_robot`, or a humanoid.

    Args:
        definition: as of :func:`get_robot`; or one of :data:`.biped_file.BIPEDS`, or a
            humanoid's YAML file.

    Raises:
        InputError: if there is no such robot, or the file or its URDF will not do.
    """
    if is_biped_file(definition):
        return read_humanoid(definition)
    if is_robot_file(definition) or definition in _READ or definition in ROBOTS:
        return get_robot(definition)
    raise InputError(
        f"Unknown robot {quoted(definition)}; the choices are "
        f"{', '.join((*ROBOTS, *BIPEDS))}, or a robot's YAML file."
    )


def known_robot(name: str) -> Robot | None:
    """Returns the robot of a name that :func:`get_robot` knows, or None."""
    return get_robot(name) if name in (*ROBOTS, *_READ) else None


def load_robot(definition: str) -> Quadruped:
    """Returns a robot to retarget to: one of ROBOTS, or that in a YAML file.

    In contrast to :func:`get_robot` it may have any legs, and neither masses nor
    motors.

    Raises:
        InputError: if there is no such robot, or the file or its URDF will not do.
    """
    if is_robot_file(definition):
        return read_robot(Path(definition))
    return get_robot(definition)


def load_figure(definition: str) -> LeggedRobot:
    """Returns a robot to look at: as :func:`load_robot`, or a humanoid.

    Raises:
        InputError: if there is no such robot, or the file or its URDF will not do.
    """
    if is_biped_file(definition):
        return read_biped(definition)
    return load_robot(definition)


def robot_settings(path: Path) -> tuple[Setting, ...]:
    """Returns what the robot in a YAML file is simulated with, each with its source.

    Raises:
        InputError: as :func:`get_simulated`.
    """
    if is_biped_file(str(path)):
        return humanoid_settings(str(path))
    return _read_file(path.resolve())[1]


@lru_cache
def _read_file(path: Path) -> tuple[Robot, tuple[Setting, ...]]:
    return read_own_robot(path)


@lru_cache
def _read_shipped(name: str) -> Robot:
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
        least_payload=LEAST_PAYLOAD,
        mass=float(plant.CalcTotalMass(context)),
        p_BHip=p_BHip,
        abduction_offset=p_BThigh[:, 1] - p_BHip[:, 1],
        thigh_length=float(p_BThigh[0, 2] - p_BCalf[0, 2]),
        calf_length=float(p_BCalf[0, 2] - p_BF[0, 2]),
        joint_signs=np.ones(len(names)),
        joint_zeros=np.zeros(len(names)),
        knee_signs=np.full(len(LEGS), -1.0),
        knee_offset=np.zeros(len(LEGS)),
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
