"""Physical parameters of a robot in the Context of its plant, and their bounds."""

from functools import lru_cache
from math import ceil

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody, SpatialInertia
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError

from .plant import PlantConfig
from .robots import Robot, get_robot

LEAST_PAYLOAD = -3.0  # kg; bounds hold down to this payload

_POSES, _REFINED = 1000, 4


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
    """Sets the inertia of the rotors at the joints of Go2 or A1.

    It is by actuator, kg m^2, shape (12,), and may be negative within bounds.

    Raises:
        InputError: if the mass matrix would not be positive definite in every pose.
    """
    indices = plant.GetJointActuatorIndices(instance)
    robot = get_robot(plant.GetModelInstanceName(instance))
    least = robot.reflected_inertia - removable_inertia(robot)
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


@lru_cache
def removable_inertia(robot: Robot) -> float:
    """Returns how much inertia all joints can lose at once, kg m^2.

    The mass matrix M remains positive definite in every pose within the joint limits: M
    - c S S', where S selects the joints' columns, is positive definite while c is below
    the smallest eigenvalue of (S' M^-1 S)^-1. The minimum over poses is searched from
    many starts, with the trunk lightened by :data:`LEAST_PAYLOAD`, and rounded down to
    1e-4.
    """
    from scipy.optimize import minimize

    plant = MultibodyPlant(time_step=0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    trunk = plant.GetBodyByName(robot.trunk_frame)
    SetTrunkLoad(trunk, context, mass=LEAST_PAYLOAD, p_shift_B=np.zeros(3))

    def least(joints: Array) -> float:
        plant.SetPositions(context, [1.0, *[0.0] * 6, *joints])
        M = plant.CalcMassMatrix(context)
        return float(1 / np.linalg.eigvalsh(np.linalg.inv(M)[6:, 6:])[-1])

    low, high = robot.joint_lower, robot.joint_upper
    poses = np.random.default_rng(0).uniform(low, high, (_POSES, len(low)))
    bounds = list(zip(low, high, strict=True))
    worst = sorted(poses, key=least)[:_REFINED]
    found = [minimize(least, q, bounds=bounds, method="L-BFGS-B").fun for q in worst]
    return int(1e4 * min(found)) / 1e4


def surplus_inertia(robot: Robot, plant: PlantConfig) -> Array:
    """Returns the apparent inertia of the implicit PD at zero motor strength, (12,).

    In kg m^2; see :class:`loco_drake.systems.domain.Actuation`.
    """
    h = 0.0 if plant.contact == "cenic" else plant.time_step
    return (robot.kd + robot.kp * h) * h


def least_strength(robot: Robot, plant: PlantConfig) -> float:
    """Returns the smallest valid motor strength, relative to the model.

    A motor of strength s loses (1 - s) times :func:`surplus_inertia`, which may not
    exceed :func:`removable_inertia`. Rounded up to 1 %.
    """
    surplus = float(surplus_inertia(robot, plant).max())
    if surplus == 0:
        return 0.0
    return max(0.0, ceil(100 * (1 - removable_inertia(robot) / surplus)) / 100)


def check_strength(robot: Robot, plant: PlantConfig, strength: float) -> None:
    """Raises InputError if the motors are too weak; see :func:`least_strength`."""
    least = least_strength(robot, plant)
    if not least <= strength < np.inf:
        raise InputError(
            f"The motor strength of {robot.name} must be at least {least:g} at a time "
            f"step of {plant.time_step:g} s, not {strength:g}: below, the mass matrix "
            "would not be positive definite in every pose."
        )
