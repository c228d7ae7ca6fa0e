"""A humanoid from its YAML file as a :class:`.humanoid.Humanoid`, to be simulated.

Masses, limits and torques are the URDF's; what it does not say is derived, see
:func:`humanoid_settings`.
"""

import copy
import xml.etree.ElementTree as ET
from dataclasses import fields
from functools import lru_cache

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.errors import InputError
from loco_drake.common.gravity import GRAVITY

from .biped import Biped
from .biped_file import BipedFile, read_biped, read_biped_file
from .humanoid import Humanoid
from .humanoid_urdf import write_humanoid
from .legs import MIRROR_AXIAL, MIRROR_POLAR
from .own_robots import DISSIPATION, ROTOR_SHARE, SINKING, Setting
from .parsing import AddUrdf
from .rigid_model import read_effort
from .robot_urdf import Motors
from .urdf import read_xml, unreadable

_SPHERES = 8  # of the soles
# What left and right may differ by: in the directions of axes, in m, and of masses.
_SAME_AXIS, _SAME_PLACE, _SAME_MASS = 1e-3, 2e-3, 0.02


@lru_cache
def read_humanoid(definition: str) -> Humanoid:
    """Returns a humanoid to be simulated, by its name or YAML file.

    Raises:
        InputError: as :func:`.biped_file.read_biped`; or if a joint has no limit of
            torque, the robot is not its own mirror image, or its masses contradict each
            other.
    """
    robot = read_biped(definition)
    file, urdf = read_biped_file(definition)
    try:
        return _make(robot, file, read_xml(urdf))
    except InputError as error:
        raise InputError(f"{robot.definition}: {error}") from None
    except (RuntimeError, ValueError) as error:
        raise unreadable(urdf, error) from None


def humanoid_settings(definition: str) -> tuple[Setting, ...]:
    """Returns what a humanoid is simulated with, each with its source.

    Raises:
        InputError: as :func:`read_humanoid`.
    """
    robot, file = read_humanoid(definition), read_biped_file(definition)[0].simulation
    ratio = f"damping ratio {file.damping_ratio:g} about the inertia in the stance"

    def span(values: Array, unit: str) -> str:
        return f"{values.min():.3g} to {values.max():.3g} {unit}"

    square = f"{ROTOR_SHARE:g} s^2 times effort^2, as Go2's and A1's"
    limit = f"the torque limit at {file.give:g} rad"
    weight = f"an eighth of the robot sinks in by {1000 * SINKING:g} mm"
    return (
        Setting("mass", f"{robot.mass:.4g} kg", "URDF"),
        Setting("effort", span(robot.effort_limits, "N m"), "URDF"),
        Setting(
            "rotors, at the joint", span(robot.reflected_inertia, "kg m^2"), square
        ),
        Setting("joint inertia", span(robot.joint_inertia, "kg m^2"), "URDF, rotors"),
        Setting("kp", span(robot.kp, "N m/rad"), limit),
        Setting("kd", span(robot.kd, "N m s/rad"), ratio),
        Setting("foot friction", f"{file.foot_friction:g}", "rubber"),
        Setting("foot stiffness", f"{_stiffness(robot.mass):.3g} N/m", weight),
    )


def _make(robot: Biped, file: BipedFile, root: ET.Element) -> Humanoid:
    names, own = robot.joint_names, file.simulation
    effort = np.array([read_effort(root, name) for name in names])
    for name, value in zip(names, effort, strict=True):
        if not 0 < value < np.inf:
            raise InputError(f"The URDF has no torque limit of {name}.")
    rotors = ROTOR_SHARE * effort**2
    kp = effort / own.give
    limits = robot.joint_lower, robot.joint_upper, robot.joint_speed_limits
    # The damping follows from inertias, which do not depend on it.
    bare = Motors(*limits, effort, rotors, kp, np.ones_like(kp))
    plant = _plant(_write(root, robot, bare, own.foot_friction, 1.0))
    _check_order(plant, robot)
    axes, origins = _joint_axes(plant, robot)
    mirror, signs = _mirror(robot, axes, origins)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, [1.0, *[0.0] * 6, *robot.stand_joints])
    M = plant.CalcMassMatrix(context)
    if np.linalg.eigvalsh(M)[0] <= 0:
        raise InputError("The URDF's masses and inertias contradict each other.")
    inertia = np.diag(M)[6:].copy()
    off = np.abs(inertia - inertia[mirror]) / inertia
    if off.max() > _SAME_MASS:
        raise InputError(
            f"To be simulated a humanoid must be its own mirror image, but the inertia "
            f"about {names[int(off.argmax())]} is another than on the other side."
        )
    # Left and right differ by the URDF's rounding.
    inertia = (inertia + inertia[mirror]) / 2
    kd = 2 * own.damping_ratio * np.sqrt(kp * inertia)
    mass = float(plant.CalcTotalMass(context))
    motors = bare._replace(kd=kd)
    soles = robot.sole_ends(np.zeros(len(names))).reshape(2, 2, 3).swapaxes(0, 1)
    legs = slice(robot.leg_joints), (2, robot.leg_joints // 2, 3)
    same = {field.name: getattr(robot, field.name) for field in fields(Biped)}
    return Humanoid(
        **same,
        simulation=_write(root, robot, motors, own.foot_friction, _stiffness(mass)),
        leg_axes=axes[legs[0]].reshape(legs[1]),
        leg_origins=origins[legs[0]].reshape(legs[1]),
        sole_origins=soles.copy(),
        effort_limits=effort,
        reflected_inertia=rotors,
        joint_inertia=inertia,
        kp=kp,
        kd=kd,
        mass=mass,
        # Fallen is a pelvis at less than half its height, or next to the ground.
        trunk_size=robot.stand_height * np.array([0.2, 0.3, 1.0]),
        mirror_joints=mirror,
        mirror_joint_signs=signs,
    )


def _write(
    root: ET.Element, robot: Biped, motors: Motors, friction: float, stiffness: float
) -> str:
    return write_humanoid(
        copy.deepcopy(root),
        robot,
        motors,
        friction=friction,
        stiffness=stiffness,
        dissipation=DISSIPATION,
    )


def _stiffness(mass: float) -> float:
    """Returns the stiffness of each sphere of the soles, N/m."""
    return mass * GRAVITY / _SPHERES / SINKING


def _plant(text: str) -> MultibodyPlant:
    plant = MultibodyPlant(time_step=0.0)
    AddUrdf(Parser(plant), model=text, visual=False)
    plant.Finalize()
    return plant


def _check_order(plant: MultibodyPlant, robot: Biped) -> None:
    """Raises InputError unless states are [q, v] of the trunk, then of the joints."""
    trunk = plant.GetFrameByName(robot.trunk_frame)
    (root,) = plant.GetFloatingBaseBodies()
    if not (trunk.is_body_frame() and trunk.body().index() == root):
        raise InputError(
            "To be simulated the trunk must be the root of the URDF, not "
            f"{trunk.name()}."
        )
    starts = [plant.GetJointByName(n).position_start() for n in robot.joint_names]
    if starts != list(range(7, 7 + len(starts))):
        raise InputError(
            "To be simulated joints must be named limb by limb, from the trunk outward."
        )


def _joint_axes(plant: MultibodyPlant, robot: Biped) -> tuple[Array, Array]:
    """Returns axes and origins of all joints in B, all joints at zero, (J, 3) each."""
    context = plant.CreateDefaultContext()
    base = plant.GetFrameByName(robot.trunk_frame)
    axes, origins = [], []
    for name in robot.joint_names:
        joint = plant.GetJointByName(name)
        X_BJ = joint.frame_on_child().CalcPose(context, base)
        axes.append(X_BJ.rotation() @ joint.revolute_axis())
        origins.append(X_BJ.translation())
    return np.array(axes), np.array(origins)


def _mirror(robot: Biped, axes: Array, origins: Array) -> tuple[Integers, Array]:
    """Returns the joint whose mirror image each joint is, and the signs of angles.

    The mirror image of a turn about an axis a, in the plane y = 0, is one about the
    axial vector (-a_x, a_y, -a_z).
    """
    joints, half = len(axes), (robot.leg_joints // 2, robot.arm_joints // 2)
    order = np.arange(joints)
    for first, count in ((0, half[0]), (joints - 2 * half[1], half[1])):
        limb = np.arange(first, first + count)
        order[limb], order[limb + count] = limb + count, limb
    signs = np.sum(axes[order] * MIRROR_AXIAL * axes, axis=-1)
    off = np.abs(np.abs(signs) - 1) > _SAME_AXIS
    off |= np.abs(origins[order] * MIRROR_POLAR - origins).max(axis=-1) > _SAME_PLACE
    if off.any():
        raise InputError(
            "To be simulated a humanoid must be its own mirror image with all joints "
            f"at zero, but {robot.joint_names[int(off.argmax())]} is not where that "
            "of the other side is."
        )
    return order, np.sign(signs)
