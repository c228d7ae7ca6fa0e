"""A robot from a short YAML file beside its URDF.

The file names the trunk's frame, and of each leg its joints from the trunk to the toe,
the frame at the centre of its toe's sphere, and the usual stance::

    urdf: solo8.urdf
    trunk: base_link
    foot_radius: 0.016
    legs:
      FL: {joints: [FL_HFE, FL_KFE], foot: FL_FOOT, stand: [0.8, -1.6]}
      ...
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.common.yaml import yaml_load_typed
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint

from loco_drake.common.errors import InputError, check_choice

from .chains import ChainRobot
from .legs import LEGS
from .meshes import vendor_folder
from .quadruped import Quadruped
from .robots import ROBOTS, get_robot

Array = NDArray[np.float64]

SUFFIXES = (".yaml", ".yml")

# What is left of a URDF: what moves, and how.
_KEPT = {
    "robot": {"link", "joint", "frame"},
    "joint": {"parent", "child", "origin", "axis", "limit"},
}


# Not frozen: yaml_load_typed sets the fields one by one.
@dataclass(kw_only=True)
class LegFile:
    """One leg of a robot."""

    # Names of its joints, from the trunk to the toe; all of them revolute.
    joints: list[str] = field(default_factory=list)
    # The link, or frame, at the centre of the sphere that touches the ground.
    foot: str = ""
    # The joints in the usual stance, rad.
    stand: list[float] = field(default_factory=list)
    # Limits, where those of the URDF do not suit: rad, rad and rad/s.
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    speed: list[float] = field(default_factory=list)


@dataclass(kw_only=True)
class RobotFile:
    """A robot to retarget to."""

    # By default that of the file.
    name: str = ""
    # Relative to this file, or package://NAME/..., where NAME is example-robot-data or
    # lies below a folder of ROS_PACKAGE_PATH.
    urdf: str = ""
    # The frame of the trunk, x forward, y left, z up, between the hips.
    trunk: str = ""
    # Of the spheres at the feet, m.
    foot_radius: float = 0.0
    # By FL, FR, RL and RR.
    legs: dict[str, LegFile] = field(default_factory=dict)


def is_robot_file(definition: str) -> bool:
    """Returns whether this is a path to a robot's YAML file, not a name."""
    return Path(definition).suffix in SUFFIXES


def load_robot(definition: str) -> Quadruped:
    """Returns the robot of that name, or the one in that YAML file.

    Raises:
        InputError: if there is no such robot, or the file or its URDF will not do.
    """
    if is_robot_file(definition):
        return read_robot(Path(definition))
    if definition not in ROBOTS:
        raise InputError(
            f"Unknown robot {definition!r}; the choices are {', '.join(ROBOTS)}, or "
            "a robot's YAML file."
        )
    return get_robot(definition)


def read_robot(path: Path) -> ChainRobot:
    """Returns the robot in a YAML file; see :class:`RobotFile`.

    Raises:
        InputError: naming what is missing, unknown or impossible.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"There is no robot file {str(path)!r}.")
    try:
        file = yaml_load_typed(
            schema=RobotFile, filename=str(path), defaults=RobotFile()
        )
    except Exception as error:  # Drake and PyYAML raise many kinds
        reason = " ".join(str(error).split())
        raise InputError(f"{path} is not a robot file: {reason}") from None
    try:
        _check(file)
        return _make(file, path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _check(file: RobotFile) -> None:
    """Raises InputError unless the file is complete and agrees with itself."""
    missing = [name for name in ("urdf", "trunk", "legs") if not getattr(file, name)]
    if missing:
        raise InputError(f"It lacks {', '.join(missing)}.")
    if not 0 < file.foot_radius < float("inf"):
        raise InputError(f"foot_radius must be above 0 m, not {file.foot_radius}.")
    if set(file.legs) != set(LEGS):
        raise InputError(
            f"legs must be {', '.join(LEGS)}, not {', '.join(sorted(file.legs))}."
        )
    count = len(file.legs[LEGS[0]].joints)
    for name, leg in file.legs.items():
        missing = [key for key in ("joints", "foot", "stand") if not getattr(leg, key)]
        if missing:
            raise InputError(f"Leg {name} lacks {', '.join(missing)}.")
        if len(leg.joints) != count:
            raise InputError(
                f"All legs must have as many joints, but {LEGS[0]} has {count} and "
                f"{name} {len(leg.joints)}."
            )
        for key in ("stand", "lower", "upper", "speed"):
            values = getattr(leg, key)
            if values and (len(values) != count or not np.isfinite(values).all()):
                raise InputError(
                    f"{key} of leg {name} must be {count} numbers, one for each joint."
                )
        if leg.speed and min(leg.speed) <= 0:
            raise InputError(f"speed of leg {name} must be above 0 rad/s.")


def _make(file: RobotFile, path: Path) -> ChainRobot:
    legs = [file.legs[leg] for leg in LEGS]
    joint_names = tuple(joint for leg in legs for joint in leg.joints)
    name = file.name or path.stem
    if name in ROBOTS:
        raise InputError(f"The name {name!r} is taken; give another as its name.")
    model = _kinematic_urdf(_find_urdf(file.urdf, path.parent), joint_names)
    plant = MultibodyPlant(time_step=0.0)
    try:
        Parser(plant).AddModelsFromString(model, "urdf")
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"Drake cannot read {file.urdf}: {reason}") from None
    # Drake adds frames of its own, which nobody means.
    tags = ET.fromstring(model)
    frames = [str(tag.get("name")) for tag in tags if tag.tag in ("link", "frame")]
    check_choice("trunk", file.trunk, frames)
    for leg in legs:
        check_choice("foot", leg.foot, frames)
    joints = [_revolute(plant, name) for name in joint_names]
    plant.Finalize()
    for key, leg in zip(LEGS, legs, strict=True):
        _check_path(plant, key, leg, joint_names)

    lower = _limits(legs, "lower", [j.position_lower_limits()[0] for j in joints])
    upper = _limits(legs, "upper", [j.position_upper_limits()[0] for j in joints])
    speed = _limits(legs, "speed", [j.velocity_upper_limits()[0] for j in joints])
    stand = np.array([angle for leg in legs for angle in leg.stand])
    wrong = [
        f"{joint} at {angle:g} rad is not within {low:g} to {high:g}"
        for joint, low, angle, high in zip(
            joint_names, lower, stand, upper, strict=True
        )
        if not low <= angle <= high
    ]
    if wrong:
        raise InputError(f"In the stance {wrong[0]}.")
    axes, origins, toes = _chains(plant, file.trunk, joints, [g.foot for g in legs])
    robot = ChainRobot(
        name=name,
        definition=str(path.resolve()),
        joint_names=joint_names,
        joint_lower=lower,
        joint_upper=upper,
        joint_speed_limits=speed,
        p_BHip=origins[:, 0].copy(),
        foot_radius=file.foot_radius,
        stand_joints=stand,
        stand_height=0.0,
        trunk_frame=file.trunk,
        foot_frames=tuple(leg.foot for leg in legs),
        model=model,
        axes=axes,
        origins=origins,
        toes=toes,
    )
    lowest = float(robot.toe_positions(stand)[:, 2].min())
    if lowest >= 0:
        raise InputError("In the stance the feet are not below the trunk.")
    return replace(robot, stand_height=file.foot_radius - lowest)


def _find_urdf(url: str, folder: Path) -> Path:
    """Returns the path of a URDF, which exists."""
    if url.startswith("package://"):
        packages = PackageMap.MakeEmpty()
        packages.PopulateFromRosPackagePath()
        packages.Add("example-robot-data", str(vendor_folder()))
        package, _, inside = url.removeprefix("package://").partition("/")
        check_choice("package", package, packages.GetPackageNames())
        found = Path(packages.GetPath(package)) / inside
    else:
        found = folder / url
    if not found.is_file():
        raise InputError(f"There is no URDF {str(found)!r}.")
    return found


def _kinematic_urdf(path: Path, joints: tuple[str, ...]) -> str:
    """Returns a URDF of links and joints alone, in which only ``joints`` move."""
    try:
        root = ET.parse(path).getroot()
    except ET.ParseError as error:
        raise InputError(f"{path} is not XML: {error}.") from None
    for element in [root, *root.iterfind("joint"), *root.iterfind("link")]:
        for child in list(element):
            if child.tag not in _KEPT.get(element.tag, set()):
                element.remove(child)
    for joint in root.iterfind("joint"):
        if joint.get("name") not in joints:
            joint.set("type", "fixed")
    return ET.tostring(root, encoding="unicode")


def _revolute(plant: MultibodyPlant, name: str) -> RevoluteJoint:
    names = [plant.get_joint(i).name() for i in plant.GetJointIndices()]
    joint = plant.GetJointByName(check_choice("joint", name, names))
    if not isinstance(joint, RevoluteJoint):
        raise InputError(
            f"Joint {name} is {joint.type_name()}; only revolute ones make a leg."
        )
    return joint


def _check_path(
    plant: MultibodyPlant, key: str, leg: LegFile, all_joints: tuple[str, ...]
) -> None:
    """Raises InputError unless the joints of a leg, and no others, move its foot."""
    foot = plant.GetFrameByName(leg.foot).body().index()

    def moved(joint: str) -> list[object]:
        index = plant.GetJointByName(joint).index()
        return plant.GetBodiesKinematicallyAffectedBy([index])

    moving = [joint for joint in all_joints if foot in moved(joint)]
    # A joint moves fewer bodies the further it is from the trunk.
    moving.sort(key=lambda joint: -len(moved(joint)))
    if moving != leg.joints:
        raise InputError(
            f"Foot {leg.foot} of leg {key} is moved by the joints "
            f"{', '.join(moving) or '(none)'}, in this order, "
            f"not by {', '.join(leg.joints)}."
        )


def _limits(legs: list[LegFile], key: str, defaults: list[float]) -> Array:
    """Returns the limits of all joints: those of the file, else of the URDF."""
    count = len(legs[0].joints)
    rows = [
        getattr(leg, key) or defaults[k * count : (k + 1) * count]
        for k, leg in enumerate(legs)
    ]
    return np.concatenate(rows).astype(np.float64)


def _chains(
    plant: MultibodyPlant, trunk: str, joints: list[RevoluteJoint], feet: list[str]
) -> tuple[Array, Array, Array]:
    """Returns axes, origins and toes as :class:`.chains.ChainRobot` has them."""
    context = plant.CreateDefaultContext()
    base = plant.GetFrameByName(trunk)
    for joint in joints:
        joint.set_angle(context, 0.0)
    poses = [joint.frame_on_child().CalcPose(context, base) for joint in joints]
    axes = [
        X_BJ.rotation() @ joint.revolute_axis()
        for X_BJ, joint in zip(poses, joints, strict=True)
    ]
    toes = [plant.GetFrameByName(f).CalcPose(context, base).translation() for f in feet]
    origins = [X_BJ.translation() for X_BJ in poses]
    legs = (4, len(joints) // 4, 3)
    return np.reshape(axes, legs), np.reshape(origins, legs), np.array(toes)
