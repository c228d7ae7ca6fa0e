"""A humanoid from a short YAML file beside its URDF, such as ``g1/g1.yaml``."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_choice, check_number, quoted
from loco_drake.common.typed_yaml import read_yaml

from .biped import Biped
from .robot_files import named
from .urdf import find_urdf, read_limits, read_xml, strip_urdf, unreadable

BIPEDS = ("g1",)  # that are shipped
SIDES = ("left", "right")
_HEIGHTS = (0.1, 3.0)  # m, of the pelvis


@dataclass(kw_only=True)
class SoleFile:
    """The spheres on which a foot stands, in its frame, m."""

    heel: list[float] = field(default_factory=list)  # the middle of its two spheres
    toe: list[float] = field(default_factory=list)
    half_width: float = 0.0  # from there to the left sphere
    radius: float = 0.0


@dataclass(kw_only=True)
class LimbFile:
    """A leg or an arm."""

    # Names of its joints, from the trunk outward; all of them revolute.
    joints: list[str] = field(default_factory=list)
    # The joints in the usual stance, rad.
    stand: list[float] = field(default_factory=list)
    middle: str = ""  # of an arm, the link at the elbow
    end: str = ""  # the link of the foot, or at the wrist


@dataclass(kw_only=True)
class MotorsFile:
    """What simulating a humanoid takes beyond its URDF."""

    # Angle from the set-point at which a motor reaches its torque limit, rad.
    give: float = 0.25
    # Damping ratio of each joint about its inertia in the stance.
    damping_ratio: float = 1.0
    # Coulomb's coefficient of the soles.
    foot_friction: float = 0.8

    def check(self) -> None:
        """Raises InputError unless all is within bounds."""
        for name, least, most in (
            ("give", 0.01, 3.0),
            ("damping_ratio", 0.1, 5.0),
            ("foot_friction", 0.05, 3.0),
        ):
            check_number(f"simulation.{name}", getattr(self, name), least, most)


@dataclass(kw_only=True)
class BipedFile:
    """A humanoid to retarget to, and to simulate."""

    # By default that of the file.
    name: str = ""
    # Relative to this file, or package://NAME/...
    urdf: str = ""
    # The link of the pelvis, x forward, y left, z up; and that of the chest.
    trunk: str = ""
    chest: str = ""
    sole: SoleFile = field(default_factory=SoleFile)
    # Names of the joints between them; they are at zero in the stance.
    waist: list[str] = field(default_factory=list)
    # By left and right.
    legs: dict[str, LimbFile] = field(default_factory=dict)
    arms: dict[str, LimbFile] = field(default_factory=dict)
    simulation: MotorsFile = field(default_factory=MotorsFile)


def read_biped(definition: str) -> Biped:
    """Returns a humanoid, given one of :data:`BIPEDS` or its YAML file.

    Raises:
        InputError: naming what is missing, unknown or impossible.
    """
    return _read(_path(definition), definition if definition in BIPEDS else "")


def read_biped_file(definition: str) -> tuple[BipedFile, Path]:
    """Returns what a humanoid's file says, and where its URDF is.

    Raises:
        InputError: as :func:`read_biped`.
    """
    path = _path(definition)
    file = read_yaml(path, BipedFile, "a humanoid's file")
    with named(path):
        _check(file)
        file.simulation.check()
        return file, find_urdf(file.urdf, path.parent)


def _path(definition: str) -> Path:
    if definition in BIPEDS:
        return Path(__file__).parent / definition / f"{definition}.yaml"
    if Path(definition).suffix in (".yaml", ".yml"):
        return Path(definition).resolve()
    raise InputError(
        f"Unknown humanoid {quoted(definition)}; the choices are "
        f"{', '.join(BIPEDS)}, or a humanoid's YAML file."
    )


def is_biped_file(definition: str) -> bool:
    """Returns whether this names a shipped humanoid, or a file that has arms."""
    path = Path(definition)
    if path.suffix not in (".yaml", ".yml") or not path.is_file():
        return definition in BIPEDS
    return "\narms:" in path.read_text(encoding="utf-8", errors="replace")


@lru_cache
def _read(path: Path, definition: str) -> Biped:
    file = read_yaml(path, BipedFile, "a humanoid's file")
    with named(path):
        _check(file)
        return _make(file, path, definition or str(path))


def _check(file: BipedFile) -> None:
    """Raises InputError unless the file is complete and agrees with itself."""
    needed = ("urdf", "trunk", "chest", "waist", "legs", "arms")
    if missing := [name for name in needed if not getattr(file, name)]:
        raise InputError(f"It lacks {', '.join(missing)}.")
    for name, limbs in (("legs", file.legs), ("arms", file.arms)):
        if set(limbs) != set(SIDES):
            raise InputError(f"{name} must be left and right, not {', '.join(limbs)}.")
        if len({len(limb.joints) for limb in limbs.values()}) > 1:
            raise InputError(f"Both {name} must have as many joints.")
        for side, limb in limbs.items():
            parts = ["joints", "stand", "end", *["middle"] * (name == "arms")]
            if missing := [key for key in parts if not getattr(limb, key)]:
                raise InputError(f"{name}: {side} lacks {', '.join(missing)}.")
            if len(limb.stand) != len(limb.joints) or not np.isfinite(limb.stand).all():
                raise InputError(
                    f"stand of {name}: {side} must be {len(limb.joints)} numbers, one "
                    "for each joint."
                )
            if len(limb.joints) < 2:
                raise InputError(f"{name}: {side} needs at least two joints.")
    joints = _joints(file)
    twice = sorted({joint for joint in joints if joints.count(joint) > 1})
    if twice:
        raise InputError(f"Each joint is in one limb, but {twice[0]} is named twice.")
    sole = file.sole
    if not (len(sole.heel) == len(sole.toe) == 3 and sole.toe[0] > sole.heel[0]):
        raise InputError("sole needs heel and toe, three numbers each, toe ahead.")
    if not (0 < sole.radius < 1 and 0 <= sole.half_width < 1):
        raise InputError("sole needs a radius above 0 and a half_width, in m.")


def _joints(file: BipedFile) -> list[str]:
    legs = [joint for side in SIDES for joint in file.legs[side].joints]
    arms = [joint for side in SIDES for joint in file.arms[side].joints]
    return [*legs, *file.waist, *arms]


def _make(file: BipedFile, path: Path, definition: str) -> Biped:
    """Returns the robot; raises InputError if its URDF does not fit the file."""
    names = _joints(file)
    urdf = find_urdf(file.urdf, path.parent)
    root = read_xml(urdf)
    elements = {str(joint.get("name")): joint for joint in root.iterfind("joint")}
    links = [str(link.get("name")) for link in root.iterfind("link")]
    limbs = [*file.legs.values(), *file.arms.values()]
    ends = [limb.end for limb in limbs] + [arm.middle for arm in file.arms.values()]
    for link in (file.trunk, file.chest, *ends):
        check_choice("link", link, links)
    limits = np.array(
        [read_limits(elements[check_choice("joint", n, elements)]) for n in names]
    )
    lower, upper, speed = limits.T.copy()
    stand = np.concatenate(
        [
            *(file.legs[side].stand for side in SIDES),
            np.zeros(len(file.waist)),
            *(file.arms[side].stand for side in SIDES),
        ]
    )
    for name, low, angle, high in zip(names, lower, stand, upper, strict=True):
        if not low <= angle <= high:
            raise InputError(
                f"In the stance {name} at {angle:g} rad is not within {low:g} to "
                f"{high:g}."
            )
    robot = Biped(
        name=file.name or path.stem,
        definition=definition,
        joint_names=tuple(names),
        joint_lower=lower,
        joint_upper=upper,
        joint_speed_limits=speed,
        foot_radius=file.sole.radius,
        stand_joints=stand,
        stand_height=0.0,
        trunk_frame=file.trunk,
        model=strip_urdf(root, names),
        leg_joints=2 * len(file.legs["left"].joints),
        arm_joints=2 * len(file.arms["left"].joints),
        foot_frames=tuple(file.legs[side].end for side in SIDES),
        heel=np.array(file.sole.heel),
        toe=np.array(file.sole.toe),
        sole_half_width=file.sole.half_width,
        p_BHip=np.zeros((2, 3)),
        chest_frame=file.chest,
        arm_frames=tuple((file.arms[s].middle, file.arms[s].end) for s in SIDES),
        shoulder_joints=tuple(file.arms[side].joints[1] for side in SIDES),
    )
    try:
        origins = robot.joint_origins(stand)
    except (RuntimeError, ValueError) as error:
        raise unreadable(urdf, error) from None
    soles = robot.toe_positions(stand)
    _check_stance(soles, origins)
    height = file.sole.radius - float(soles[:, 2].min())
    hips = origins[[0, robot.leg_joints // 2]]
    return replace(robot, p_BHip=hips, stand_height=height)


def _check_stance(soles: Array, origins: Array) -> None:
    """Raises InputError unless the feet are flat under the pelvis, left on the left."""
    low, high = _HEIGHTS
    height = -float(soles[:, 2].min())
    if not low <= height <= high:
        raise InputError(
            f"In the stance the pelvis would be {height:.3g} m over the soles, not "
            f"{low:g} to {high:g} m."
        )
    if np.ptp(soles[:, 2]) > 0.02 * height:
        raise InputError("In the stance the soles must be level; change stand.")
    left, right = soles.reshape(2, 2, 2, 3).mean(axis=(0, 2))
    if not left[1] > right[1]:
        raise InputError("In the stance the left foot must be left of the right one.")
    if not np.isfinite(origins).all():
        raise InputError("Joints have no place.")
