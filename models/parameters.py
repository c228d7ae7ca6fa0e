"""Physical parameters of a robot, set in a Context of its plant."""

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import Context


def SetTrunkLoad(
    plant: MultibodyPlant,
    context: Context,
    *,
    mass: float,
    p_shift_B: NDArray[np.float64],
) -> None:
    """Makes the trunk heavier and moves its centre of mass, both against the model.

    The rotational inertia about the centre of mass grows in proportion to the mass, as
    if the trunk were denser.

    Args:
        plant: with a robot of :func:`.robots.AddRobotModel`.
        context: the plant's.
        mass: added, kg; negative ones make the trunk lighter.
        p_shift_B: of the centre of mass, in B, m, shape (3,).
    """
    trunk = plant.GetBodyByName("base")
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
    plant: MultibodyPlant, context: Context, inertia: NDArray[np.float64]
) -> None:
    """Sets the inertia of the rotors as seen at the joints.

    Args:
        plant: with a robot of :func:`.robots.AddRobotModel`.
        context: the plant's.
        inertia: by actuator, kg m^2, shape (12,).
    """
    for index, value in zip(plant.GetJointActuatorIndices(), inertia, strict=True):
        actuator = plant.get_joint_actuator(index)
        ratio = actuator.default_gear_ratio()
        actuator.SetRotorInertia(context, value / ratio**2)
