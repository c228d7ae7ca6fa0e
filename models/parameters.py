"""Physical parameters of a robot in the Context of its plant, and their bounds."""

from math import ceil

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody, SpatialInertia
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError

from .plant import PlantConfig
from .robots import Robot, get_robot


def SetTrunkLoad(
    trunk: RigidBody, context: Context, *, mass: float, p_shift_B: Array
) -> None:
    """Adds mass in kg to the trunk, and shifts its centre of mass, m, shape (3,).

    The rotational inertia about the centre of mass scales with the mass, as for a
    denser trunk. The mass may be negative. ``context`` is the plant's.
    """
    M_BBo = trunk.default_spatial_inertia()
    own = M_BBo.get_mass()
    p_BoBcm = M_BBo.get_com()
    I_BBcm = M_BBo.Shift(p_BoBcm).CalcRotationalInertia()
    trunk.SetSpatialInertiaInBodyFrame(
        context,
        SpatialInertia.MakeFromCentralInertia(
            mass=own + mass,
            p_PScm_E=p_BoBcm + p_shift_B,
            I_SScm_E=I_BBcm * ((own + mass) / own),
        ),
    )


def SetReflectedInertia(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    context: Context,
    inertia: Array,
) -> None:
    """Sets the inertia of the rotors at the joints of a robot.

    It is by actuator, kg m^2, shape (12,), and may be negative within bounds.

    Raises:
        InputError: if the mass matrix would not be positive definite in every pose.
    """
    indices = plant.GetJointActuatorIndices(instance)
    robot = get_robot(plant.GetModelInstanceName(instance))
    least = robot.reflected_inertia - robot.removable_inertia
    if not (np.isfinite(inertia) & (inertia >= least)).all():
        raise InputError(
            f"With a reflected inertia of {np.min(inertia):.3g} kg m^2 the mass matrix "
            f"of {robot.name} is not positive definite in every pose; the least are "
            f"{', '.join(f'{value:.4f}' for value in least[:3])} in a leg."
        )
    for index, value in zip(indices, inertia, strict=True):
        actuator = plant.get_joint_actuator(index)
        ratio = actuator.default_gear_ratio()
        actuator.SetRotorInertia(context, value / ratio**2)


def surplus_inertia(robot: Robot, plant: PlantConfig) -> Array:
    """Returns the apparent inertia of the implicit PD at zero motor strength, (12,).

    In kg m^2; see :class:`loco_drake.systems.domain.Actuation`.
    """
    h = 0.0 if plant.contact == "cenic" else plant.time_step
    return robot.kd * h


def least_strength(robot: Robot, plant: PlantConfig) -> float:
    """Returns the smallest valid motor strength, relative to the model.

    A motor of strength s loses (1 - s) times :func:`surplus_inertia`, which may not
    exceed the robot's ``removable_inertia``. Rounded up to 1 %.
    """
    surplus = float(surplus_inertia(robot, plant).max())
    if surplus == 0:
        return 0.0
    return max(0.0, ceil(100 * (1 - robot.removable_inertia / surplus)) / 100)


def check_strength(robot: Robot, plant: PlantConfig, strength: float) -> None:
    """Raises InputError if the motors are too weak; see :func:`least_strength`.

    Of motors with another damping, ``strength`` is theirs times the damping's factor.
    """
    least = least_strength(robot, plant)
    if not least <= strength < np.inf:
        raise InputError(
            f"The motor strength of {robot.name} must be at least {least:g} at a time "
            f"step of {plant.time_step:g} s, not {strength:g}: below, the mass matrix "
            "would not be positive definite in every pose. A factor of the damping "
            "multiplies it."
        )
