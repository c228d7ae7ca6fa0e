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

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.typed_yaml import read_yaml

from .chains import ChainRobot
from .legs import LEGS
from .robot import ROBOTS
from .simulation_file import SimulationFile
from .urdf import LIMITS, LegFile, find_urdf, read_legs

SUFFIXES = (".yaml", ".yml")

# Smaller and larger robots are taken for millimetres, or for legs that fold away; m.
STAND_HEIGHTS = (0.03, 3.0)
# Of the radius of a foot over the height of the trunk over it.
_MAX_FOOT = 0.4
# An axis is where it should be if it is off by less than 45 degrees.
_ALONG = np.sqrt(0.5)
_MAX_TURN = 20.0  # rad; more must be degrees


@dataclass(kw_only=True)
class RobotFile:
    """A robot to retarget to and, with three joints a leg, to simulate."""

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
    # Folder of its own networks (tokenizer, generator, policy), relative to this file.
    weights: str = ""
    # What simulating it takes beyond the URDF.
    simulation: SimulationFile = field(default_factory=SimulationFile)


def is_robot_file(definition: str) -> bool:
    """Returns whether this is a path to a robot's YAML file, not a name."""
    return Path(definition).suffix in SUFFIXES


def read_robot(path: Path) -> ChainRobot:
    """Returns the robot in a YAML file; see :class:`RobotFile`.

    Raises:
        InputError: naming what is missing, unknown or impossible.
    """
    file = read_file(path)
    with named(path):
        return chain_robot(file, path)


def read_file(path: Path) -> RobotFile:
    """Returns a YAML file that is complete and agrees with itself.

    Raises:
        InputError: naming what is missing or unknown.
    """
    file = read_yaml(path, RobotFile, "a robot file")
    with named(path):
        _check(file)
    return file


@contextmanager
def named(path: Path) -> Iterator[None]:
    """Begins messages of InputErrors within with the path of their file."""
    try:
        yield
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
    joints = [joint for leg in file.legs.values() for joint in leg.joints]
    twice = sorted({joint for joint in joints if joints.count(joint) > 1})
    if twice:
        raise InputError(
            f"Each joint belongs to one leg, but {twice[0]} is named twice."
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
        for key in ("stand", *LIMITS):
            values = getattr(leg, key)
            if values and (len(values) != count or not np.isfinite(values).all()):
                raise InputError(
                    f"{key} of leg {name} must be {count} numbers, one for each joint."
                )
            if key != "speed" and values and np.abs(values).max() > _MAX_TURN:
                raise InputError(
                    f"{key} of leg {name} must be in rad, not {values} (in degrees?)."
                )
        if leg.speed and min(leg.speed) <= 0:
            raise InputError(f"speed of leg {name} must be above 0 rad/s.")


def chain_robot(file: RobotFile, path: Path) -> ChainRobot:
    """Returns the kinematics of a robot in the file at ``path``.

    Raises:
        InputError: if its URDF does not fit the file.
    """
    legs = [file.legs[leg] for leg in LEGS]
    name = file.name or path.stem
    if name in ROBOTS:
        raise InputError(f"The name {name!r} is taken; give another as its name.")
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}", name):
        raise InputError(
            f"The name {name[:80]!r} must be letters, digits, _, - and ., at most 64; "
            "give another as its name."
        )
    urdf = read_legs(find_urdf(file.urdf, path.parent), file.trunk, legs)
    stand, lower, upper = urdf.stand, urdf.lower, urdf.upper
    joint_names = tuple(joint for leg in legs for joint in leg.joints)
    for joint, low, angle, high in zip(joint_names, lower, stand, upper, strict=True):
        if not low <= angle <= high:
            raise InputError(
                f"In the stance {joint} at {angle:g} rad is not within {low:g} to "
                f"{high:g}."
            )
    for joint, limit in zip(joint_names, urdf.speed, strict=True):
        if limit == 0:
            raise InputError(
                f"The URDF lets joint {joint} move at 0 rad/s; give its leg's speed."
            )
    robot = ChainRobot(
        name=name,
        definition=str(path.resolve()),
        joint_names=joint_names,
        joint_lower=lower,
        joint_upper=upper,
        joint_speed_limits=urdf.speed,
        p_BHip=urdf.origins[:, 0].copy(),
        foot_radius=file.foot_radius,
        stand_joints=stand,
        stand_height=0.0,
        trunk_frame=file.trunk,
        foot_frames=tuple(leg.foot for leg in legs),
        model=urdf.model,
        axes=urdf.axes,
        origins=urdf.origins,
        toes=urdf.toes,
    )
    toes = robot.toe_positions(stand)
    _check_trunk(file.trunk, toes, robot.p_BHip)
    length = -float(toes[:, 2].min())
    if file.foot_radius > _MAX_FOOT * length:
        raise InputError(
            f"foot_radius must be in m, not {file.foot_radius:g} for feet {length:.3g} "
            "m below the trunk (in millimetres?)."
        )
    low, high = STAND_HEIGHTS
    if not low <= length + file.foot_radius <= high:
        raise InputError(
            f"In the stance the trunk would be {length:.3g} m over the feet, not "
            f"{low:g} to {high:g} m (is the URDF in millimetres?)."
        )
    return replace(robot, stand_height=file.foot_radius + length)


def _check_trunk(trunk: str, toes: Array, hips: Array) -> None:
    """Raises InputError unless the legs are where their names say in the trunk frame.

    Toes (4, 3) in the usual stance and hips (4, 3), the first joints, are in B, in m.
    """
    ways = np.stack(
        (
            toes[:2].mean(axis=0) - toes[2:].mean(axis=0),
            toes[0::2].mean(axis=0) - toes[1::2].mean(axis=0),
            (hips - toes).mean(axis=0),
        )
    )
    # Rows: forward, left, up.
    R = ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)
    if (np.diag(R) < _ALONG).any():
        if np.linalg.det(R) > _ALONG:
            # A rotation mends it; its columns are forward, left and up in B.
            turned = RotationMatrix.ProjectToRotationMatrix(np.rint(R).T)
            rpy = " ".join(f"{angle:.5g}" for angle in RollPitchYaw(turned).vector())
            x, y, z = (_axis(row) for row in R)
            raise InputError(
                f"The axes of trunk {trunk} must be x forward, y left, z up, but by "
                f"the feet of the stance forward is {x}, left {y} and up {z}: name a "
                f'frame of the URDF such as <frame name="trunk" link="{trunk}" '
                f'rpy="{rpy}"/>, or correct the names of the legs.'
            )
        if R[2, 2] < _ALONG:
            raise InputError(
                f"In the stance the feet are not below the trunk {trunk}, whose axes "
                f"must be x forward, y left, z up: up from the feet is {_axis(R[2])}."
            )
    x, y, _ = (toes - toes.mean(axis=0)).T > 0
    wrong = [
        f"{leg} is {'front' if x[k] else 'rear'} {'left' if y[k] else 'right'}"
        for k, leg in enumerate(LEGS)
        if (x[k], y[k]) != (leg[0] == "F", leg[1] == "L")
    ]
    if wrong:
        raise InputError(
            f"In the frame of trunk {trunk}, x forward and y left, the feet must lie "
            f"where the legs' names say, but {', '.join(wrong)}."
        )
    if not hips[:2, 0].mean() > 0 > hips[2:, 0].mean():
        raise InputError(
            f"The origin of trunk {trunk} must lie between the hips, but the front "
            f"ones are at x = {hips[:2, 0].mean():.3g} m and the rear ones at "
            f"{hips[2:, 0].mean():.3g} m."
        )


def _axis(direction: Array) -> str:
    """Returns the axis that a direction is nearest to, such as "-x"."""
    k = int(np.abs(direction).argmax())
    return f"{'-' if direction[k] < 0 else '+'}{'xyz'[k]}"
