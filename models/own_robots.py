"""A robot from a YAML file as a :class:`.robot.Robot`, ready to be simulated.

What neither the file nor its URDF says is derived from what they say; each number has
its source, see :func:`read_own_robot`.
"""

from dataclasses import asdict, fields
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.gravity import GRAVITY

from .chains import ChainRobot
from .leg_geometry import leg_geometry
from .legs import LEGS, MIRROR_JOINTS
from .parsing import AddUrdf
from .quadruped import Quadruped
from .rigid_model import RigidModel, read_rigid_model
from .robot import LEAST_PAYLOAD, Robot
from .robot_files import RobotFile, chain_robot, named, read_file
from .robot_urdf import Motors, Shapes, write_urdf
from .simulation_file import SimulationFile
from .urdf import find_urdf

# Of Go2's and A1's motors: reflected inertia over the square of the torque limit, s^2.
# Gears change both alike.
ROTOR_SHARE = 8e-6
SINKING = 7.5e-4  # m, of a foot under a quarter of the robot, as of Go2 and A1
DISSIPATION = 1.0  # s/m, of Hunt and Crossley's law, as of theirs
# Height of the box of the trunk over the standing height, and its length and width over
# those between the hips.
TRUNK_HEIGHT, TRUNK_LENGTH = 0.38, 1.0
# Torque limits over weight times standing height; beyond, they are no limits.
MOST_EFFORT = 5.0
MOST_SPEED = 100.0  # rad/s
_TURNS = 8 * np.pi  # rad
_SAMPLES = 500  # poses in which the mass matrix must be sound
_SHARE = 0.8  # of what the poses allow, for those in between
_SAME_MASS = 0.02  # of a body, left and right


class Setting(NamedTuple):
    """A number of a robot, and where it is from."""

    what: str
    value: str  # with its unit
    source: str


def read_own_robot(path: Path) -> tuple[Robot, tuple[Setting, ...]]:
    """Returns the robot in a YAML file, and what it is simulated with.

    Raises:
        InputError: naming what is missing, unknown or impossible.
    """
    file = read_file(path)
    with named(path):
        return _make(file, path, chain_robot(file, path))


def _make(
    file: RobotFile, path: Path, chain: ChainRobot
) -> tuple[Robot, tuple[Setting, ...]]:
    own = file.simulation
    own.check()
    geometry = leg_geometry(chain)
    legs = [file.legs[leg] for leg in LEGS]
    model = read_rigid_model(find_urdf(file.urdf, path.parent), file.trunk, legs)
    mass = sum(body.mass for body in model.bodies)
    effort = _effort(own, model, mass * GRAVITY * chain.stand_height)
    _check_speeds(chain)
    rotors = _by_joint(own.rotor_inertia)
    if own.rotor_inertia:
        rotors = rotors * _by_joint(own.gear_ratio or [1.0] * 3) ** 2
    else:
        rotors = ROTOR_SHARE * effort**2
    shapes = _shapes(own, model, chain, mass)
    zero = np.zeros(len(chain.joint_names))
    # In a URDF there is no infinity.
    low = np.maximum(chain.joint_lower, -_TURNS)
    high = np.minimum(chain.joint_upper, _TURNS)
    limits = low, high, chain.joint_speed_limits
    # The gains follow from inertias, which do not depend on the gains.
    bare = Motors(*limits, effort, rotors, zero + 1.0, zero + 1.0)
    text = write_urdf(chain.name, model, chain.foot_frames, bare, shapes)
    plant, context = _plant(text)
    plant.SetPositions(context, [1.0, *[0.0] * 6, *chain.stand_joints])
    inertia = np.diag(plant.CalcMassMatrix(context))[6:].copy()
    # Left and right differ by the URDF's rounding.
    inertia = (inertia + inertia[MIRROR_JOINTS]) / 2
    rate = 2 * np.pi * own.natural_frequency
    kp = _by_joint(own.kp) if own.kp else inertia * rate**2
    kd = _by_joint(own.kd) if own.kd else 2 * own.damping_ratio * inertia * rate
    motors = bare._replace(kp=kp, kd=kd)
    least_payload = max(LEAST_PAYLOAD, -0.4 * model.bodies[0].mass)
    same = {field.name: getattr(chain, field.name) for field in fields(Quadruped)}
    robot = Robot(
        **same | asdict(geometry),
        model=write_urdf(chain.name, model, chain.foot_frames, motors, shapes),
        effort_limits=effort,
        reflected_inertia=rotors,
        joint_inertia=inertia,
        kp=kp,
        kd=kd,
        mass=mass,
        removable_inertia=_removable(plant, context, chain),
        least_payload=least_payload,
        trunk_size=shapes.trunk_size,
        weights=path.parent / file.weights if file.weights else None,
    )
    _check(robot, chain, model)
    return robot, _settings(robot, own, shapes)


def _by_joint(values: list[float]) -> Array:
    """Returns numbers of a leg's joints for all legs, (12,)."""
    return np.tile(np.array(values, dtype=np.float64), len(LEGS))


def _effort(own: SimulationFile, model: RigidModel, scale: float) -> Array:
    """Returns the torque limits, (12,), N m; ``scale`` is weight times height."""
    effort = _by_joint(own.effort) if own.effort else model.efforts
    for hinge, value in zip(model.hinges, effort, strict=True):
        if not 0 < value < np.inf:
            raise InputError(
                f"The URDF has no torque limit of {hinge.name}; give simulation.effort."
            )
        if value > MOST_EFFORT * scale:
            raise InputError(
                f"The torque limit of {hinge.name}, {value:g} N m, is "
                f"{value / scale:.2g} times the robot's weight times its height, which "
                "is no limit; give simulation.effort."
            )
    return effort


def _check_speeds(chain: ChainRobot) -> None:
    for joint, limit in zip(chain.joint_names, chain.joint_speed_limits, strict=True):
        if limit > MOST_SPEED:
            raise InputError(
                f"The URDF lets joint {joint} move at {limit:g} rad/s, which is no "
                "limit; give its leg's speed."
            )


def _shapes(
    own: SimulationFile, model: RigidModel, chain: ChainRobot, mass: float
) -> Shapes:
    size = np.array(own.trunk_size)
    if not own.trunk_size:
        along, across, _ = TRUNK_LENGTH * np.ptp(chain.p_BHip, axis=0)
        size = np.array([along, across, TRUNK_HEIGHT * chain.stand_height])
    stiffness = own.foot_stiffness
    if stiffness is None:
        stiffness = mass * GRAVITY / len(LEGS) / SINKING
    ends = [
        model.feet[k // 3].translation()
        if k % 3 == 2
        else model.hinges[k + 1].X_PJ.translation()
        for k in range(len(model.hinges))
    ]
    return Shapes(
        trunk_size=size,
        foot_radius=chain.foot_radius,
        knees=np.array([hinge.X_PJ.translation() for hinge in model.hinges[2::3]]),
        foot_friction=own.foot_friction,
        stiffness=stiffness,
        dissipation=DISSIPATION,
        sticks=np.array([(np.zeros(3), end) for end in ends]),
    )


def _plant(text: str) -> tuple[MultibodyPlant, Context]:
    plant = MultibodyPlant(time_step=0.0)
    AddUrdf(Parser(plant), model=text, visual=False)
    plant.Finalize()
    return plant, plant.CreateDefaultContext()


def _removable(plant: MultibodyPlant, context: Context, chain: ChainRobot) -> float:
    """Returns what all joints can lose of their inertia, see Robot.

    With S to select the joints' columns of the mass matrix M, M - c S S' is positive
    definite while c is below the smallest eigenvalue of (S' M^-1 S)^-1. A lighter trunk
    makes that a little smaller.
    """
    lower = np.maximum(chain.joint_lower, -np.pi)
    upper = np.minimum(chain.joint_upper, np.pi)
    random = np.random.default_rng(0)
    poses = random.uniform(lower, upper, (_SAMPLES, len(lower)))
    least = np.inf
    for joints in (chain.stand_joints, *poses):
        plant.SetPositions(context, [1.0, *[0.0] * 6, *joints])
        M = plant.CalcMassMatrix(context)
        if np.linalg.eigvalsh(M)[0] <= 0:
            raise InputError(
                "The mass matrix is not positive definite in every pose: the URDF's "
                "masses and inertias contradict each other."
            )
        least = min(least, 1 / np.linalg.eigvalsh(np.linalg.inv(M)[6:, 6:])[-1])
    return float(_SHARE * least)


def _check(robot: Robot, chain: ChainRobot, model: RigidModel) -> None:
    """Raises InputError unless the numbers agree with each other."""
    random = np.random.default_rng(0)
    lower = np.maximum(chain.joint_lower, -np.pi)
    upper = np.minimum(chain.joint_upper, np.pi)
    joints = random.uniform(lower, upper, (50, len(lower)))
    off = np.abs(robot.toe_positions(joints) - chain.toe_positions(joints)).max()
    if off > 0.01 * robot.calf_length:
        raise InputError(
            f"To be simulated, hips must turn about x, thighs and calves about y, but "
            f"so the feet would be {1000 * off:.2g} mm off."
        )
    stand = robot.toe_jacobians(robot.stand_joints)[:, 2]  # of z, (4, 3)
    share = np.abs(stand).ravel() * robot.mass * GRAVITY / 4 / robot.effort_limits
    if share.max() > 1:
        raise InputError(
            f"In the stance {robot.joint_names[int(share.argmax())]} would bear "
            f"{share.max():.2g} times its torque limit: the motors are too weak, or "
            "the legs too bent."
        )
    links = model.bodies[1:]
    for k, other in enumerate(MIRROR_JOINTS):
        one, two = links[k].mass, links[other].mass
        if abs(one - two) > _SAME_MASS * one:
            raise InputError(
                "To be simulated, a robot must be its own mirror image, but "
                f"{links[k].name} has {one:.4g} kg, {links[other].name} {two:.4g} kg."
            )


def _settings(robot: Robot, own: SimulationFile, shapes: Shapes) -> tuple[Setting, ...]:
    """Returns what a robot is simulated with, and why."""
    mine = "the robot's file"

    def source(name: str, otherwise: str) -> str:
        return mine if getattr(own, name) else otherwise

    def of_leg(values: Array, unit: str) -> str:
        return f"{', '.join(f'{value:.3g}' for value in values[:3])} {unit}"

    frequency = f"{own.natural_frequency:g} Hz and damping ratio {own.damping_ratio:g}"
    gains = f"{frequency} about the inertia in the stance, as Go2's and A1's"
    square = f"{ROTOR_SHARE:g} s^2 times effort^2, as Go2's and A1's"
    weight = f"a quarter of the robot sinks in by {1000 * SINKING:g} mm"
    hips = f"between the hips, {TRUNK_HEIGHT:g} of the standing height"
    return (
        Setting("mass", f"{robot.mass:.4g} kg", "URDF"),
        Setting("standing height", f"{robot.stand_height:.3g} m", "stand, URDF"),
        Setting(
            "thigh, calf",
            f"{robot.thigh_length:.3g}, {robot.calf_length:.3g} m",
            "URDF",
        ),
        Setting("effort", of_leg(robot.effort_limits, "N m"), source("effort", "URDF")),
        Setting("speed", of_leg(robot.joint_speed_limits, "rad/s"), f"URDF, or {mine}"),
        Setting(
            "rotors, at the joint",
            of_leg(robot.reflected_inertia, "kg m^2"),
            source("rotor_inertia", square),
        ),
        Setting(
            "joint inertia", of_leg(robot.joint_inertia, "kg m^2"), "URDF and rotors"
        ),
        Setting("kp", of_leg(robot.kp, "N m/rad"), source("kp", gains)),
        Setting("kd", of_leg(robot.kd, "N m s/rad"), source("kd", gains)),
        Setting("foot radius", f"{robot.foot_radius:g} m", mine),
        Setting("foot friction", f"{own.foot_friction:g}", f"rubber, or {mine}"),
        Setting(
            "foot stiffness",
            f"{shapes.stiffness:.3g} N/m",
            source("foot_stiffness", weight),
        ),
        Setting(
            "trunk's box",
            f"{' x '.join(f'{x:.3g}' for x in robot.trunk_size)} m",
            source("trunk_size", hips),
        ),
    )
