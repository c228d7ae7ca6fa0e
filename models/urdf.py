"""The legs of any robot's URDF, as chains of joints."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, RevoluteJoint
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_choice

from .legs import LEGS
from .meshes import vendor_folder

_MAX_BYTES = 20_000_000
_MAX_LENGTH = 1e5  # in the unit of the file; whether it is m is asked later
# A link beyond the foot, such as a sensor's, reaches at most this share further.
_FOOT_SHARE = 0.1

LIMITS = ("lower", "upper", "speed")

# What is left of a URDF: what moves, and how. So it needs no inertias and no meshes.
_KEPT: dict[str, set[str]] = {
    "robot": {"link", "joint", "frame"},
    "joint": {"parent", "child", "origin", "axis"},
    "link": set(),
}

# Drake welds a link of this name to the world; many files begin with one that a joint
# of any kind ties to the trunk. Here it is a link like any other.
_WORLD, _NOT_WORLD = "world", "world_link"


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


class UrdfLegs(NamedTuple):
    """Four legs of n joints each, their frames where all joints are at zero."""

    # URDF text of links and joints alone, in which only the legs' joints move.
    model: str
    axes: Array  # unit vectors along the joints' axes in B, shape (4, n, 3)
    origins: Array  # of the joints in B, m, shape (4, n, 3)
    toes: Array  # origins of the foot frames in B, m, shape (4, 3)
    stand: Array  # joints of the usual stance, rad, shape (4 n,)
    # Limits of position and speed: the robot file's, else the URDF's; rad and rad/s,
    # shape (4 n,).
    lower: Array
    upper: Array
    speed: Array


def find_urdf(url: str, folder: Path) -> Path:
    """Returns the path of a URDF, which exists.

    ``url`` is a path relative to ``folder``, or package://NAME/..., where NAME is
    example-robot-data or lies below a folder of ROS_PACKAGE_PATH.

    Raises:
        InputError: if there is no such package or file.
    """
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


def read_legs(path: Path, trunk: str, legs: Sequence[LegFile]) -> UrdfLegs:
    """Returns the legs FL, FR, RL, RR in a URDF; ``trunk`` is the name of frame B.

    Joints that are not the legs' stay at zero.

    Raises:
        InputError: naming what is missing or impossible.
    """
    names = [name for leg in legs for name in leg.joints]
    feet = [leg.foot for leg in legs]
    root = read_xml(path)
    elements = {str(joint.get("name")): joint for joint in root.iterfind("joint")}
    limits = np.array(
        [read_limits(elements[check_choice("joint", n, elements)]) for n in names]
    )
    for leg, of_leg in zip(legs, limits.reshape(4, -1, len(LIMITS)), strict=True):
        for k, key in enumerate(LIMITS):
            of_leg[:, k] = getattr(leg, key) or of_leg[:, k]
    lower, upper, speed = limits.T.copy()
    above = [_joints_above(root, foot) for foot in feet]
    model = strip_urdf(root, names)
    plant = MultibodyPlant(time_step=0.0)
    try:
        Parser(plant).AddModelsFromString(model, "urdf")
        plant.Finalize()
        # Drake passes over joints that have no links.
        moving: list[RevoluteJoint] = [plant.GetJointByName(name) for name in names]
    except (RuntimeError, ValueError) as error:
        raise unreadable(path, error) from None
    # Drake adds frames of its own, which nobody means.
    frames = [str(tag.get("name")) for tag in root if tag.tag in ("link", "frame")]
    check_choice("trunk", trunk, frames)
    for foot in feet:
        check_choice("foot", foot, frames)
    for name, leg, found in zip(LEGS, legs, above, strict=True):
        moved_by = [joint for joint in found if joint in names]
        if moved_by != leg.joints:
            raise InputError(
                f"Foot {leg.foot} of leg {name} is moved by the joints "
                f"{', '.join(moved_by) or '(none)'}, in this order, "
                f"not by {', '.join(leg.joints)}."
            )
    context = plant.CreateDefaultContext()
    base = plant.GetFrameByName(trunk)
    poses = [joint.frame_on_child().CalcPose(context, base) for joint in moving]
    axes = [
        X_BJ.rotation() @ joint.revolute_axis()
        for X_BJ, joint in zip(poses, moving, strict=True)
    ]
    origins = [X_BJ.translation() for X_BJ in poses]
    toes = [plant.GetFrameByName(f).CalcPose(context, base).translation() for f in feet]
    if not (np.abs([*origins, *toes]) < _MAX_LENGTH).all():
        raise InputError(f"{path.name} has joints more than {_MAX_LENGTH:g} m away.")
    stand = np.concatenate([leg.stand for leg in legs]).astype(np.float64)
    for joint, angle in zip(moving, stand, strict=True):
        joint.set_angle(context, angle)
    for leg in legs:
        _check_end(plant, context, leg.foot, leg.joints[0])
    return UrdfLegs(
        model=model,
        axes=np.reshape(axes, (4, -1, 3)),
        origins=np.reshape(origins, (4, -1, 3)),
        toes=np.array(toes),
        stand=stand,
        lower=lower,
        upper=upper,
        speed=speed,
    )


def unreadable(path: Path, error: Exception) -> InputError:
    """Returns the error of a URDF that Drake refuses with ``error``."""
    reason = re.sub(r"<literal-string>\S* error: ", "", str(error))
    reason = " ".join(reason.split())[:300]
    return InputError(f"Drake cannot read {path.name}: {reason}")


def read_xml(path: Path) -> ET.Element:
    """Returns the root of a URDF; raises InputError if the file is none."""
    if path.stat().st_size > _MAX_BYTES:
        raise InputError(f"{path} is not a URDF: it has more than 20 MB.")
    try:
        root = ET.parse(path).getroot()
    except (ET.ParseError, ValueError, LookupError, RecursionError) as error:
        raise InputError(f"{path} is not XML: {error}.") from None
    others = {"sdf": "an SDF file", "mujoco": "an MJCF file of MuJoCo"}
    kind = others.get(root.tag, f"XML whose root is {root.tag[:60]!r}, not 'robot'")
    if root.tag != "robot":
        raise InputError(f"{path} is {kind}; only URDF is read.")
    if any(
        "xacro" in str(element.tag) or "${" in "".join(element.attrib.values())
        for element in root.iter()
    ):
        raise InputError(
            f"{path} is a xacro file, not URDF yet: expand it with "
            f"'xacro {path.name} > {path.name.split('.')[0]}.urdf'."
        )
    return root


def read_limits(joint: ET.Element) -> tuple[float, float, float]:
    """Returns lower, upper and speed limit of a revolute joint; infinite by default.

    Drake would stop the process for limits that contradict each other.
    """
    name, kind = joint.get("name"), joint.get("type")
    if kind not in ("revolute", "continuous"):
        raise InputError(f"Joint {name} is {kind}; only revolute ones make a leg.")
    limits = {"lower": "-inf", "upper": "inf", "velocity": "inf"}
    if (element := joint.find("limit")) is not None:
        limits |= element.attrib
    try:
        lower, upper, speed = (
            float(limits[key]) for key in ("lower", "upper", "velocity")
        )
    except ValueError:
        raise InputError(f"The limits of joint {name} are not numbers.") from None
    if kind == "continuous":
        lower, upper = -np.inf, np.inf
    if not (lower <= upper and speed >= 0):
        raise InputError(
            f"The limits of joint {name} contradict each other: lower {lower:g}, upper "
            f"{upper:g} rad, velocity {speed:g} rad/s."
        )
    return lower, upper, speed


def _joints_above(root: ET.Element, foot: str) -> list[str]:
    """Returns the names of the joints from the root of the tree to a foot.

    Raises InputError if one of them follows another joint.
    """
    link_of = {f.get("name"): f.get("link") for f in root.iterfind("frame")}
    above = {_end(joint, "child"): joint for joint in root.iterfind("joint")}
    link, found = link_of.get(foot, foot), []
    while link in above and above[link] not in found:
        joint = above[link]
        found.append(joint)
        if (mimic := joint.find("mimic")) is not None:
            raise InputError(
                f"Joint {joint.get('name')}, on the way to foot {foot}, mimics "
                f"{mimic.get('joint')}; a leg's joints must move on their own."
            )
        link = _end(joint, "parent")
    return [str(joint.get("name")) for joint in reversed(found)]


def _end(joint: ET.Element, tag: str) -> str | None:
    element = joint.find(tag)
    return None if element is None else element.get("link")


def strip_urdf(
    root: ET.Element, joints: Sequence[str], *, inertial: bool = False
) -> str:
    """Returns ``root`` stripped to links and joints, of which only ``joints`` move.

    Links keep their inertia if ``inertial``. The element is changed.
    """
    kept = _KEPT | ({"link": {"inertial"}} if inertial else {})
    for element in [root, *root.iterfind("joint"), *root.iterfind("link")]:
        for child in list(element):
            if child.tag not in kept[element.tag]:
                element.remove(child)
    for element in root.iter():
        for key in ("name", "link"):
            if element.tag != "joint" and element.get(key) == _WORLD:
                element.set(key, _NOT_WORLD)
    for joint in root.iterfind("joint"):
        if joint.get("name") not in joints:
            joint.set("type", "fixed")
    return ET.tostring(root, encoding="unicode")


def _check_end(plant: MultibodyPlant, context: Context, foot: str, hip: str) -> None:
    """Raises InputError if a link of the leg reaches further than its foot."""
    frame, start = plant.GetFrameByName(foot), plant.GetJointByName(hip)

    def reach(point: Frame) -> float:
        X_HP = point.CalcPose(context, start.frame_on_parent())
        return float(np.linalg.norm(X_HP.translation()))

    # All other joints are fixed: what is beyond the foot is welded to it.
    links = plant.GetBodiesWeldedTo(frame.body())
    furthest = max(links, key=lambda link: reach(link.body_frame()))
    beyond = reach(furthest.body_frame()) - reach(frame)
    if beyond > _FOOT_SHARE * reach(frame):
        raise InputError(
            f"Foot {foot} is not the end of its leg: link {furthest.name()} reaches "
            f"{beyond:.3g} m further."
        )
