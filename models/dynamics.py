"""Inverse dynamics of a robot in the air."""

from functools import lru_cache

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array

from .legged import LeggedRobot


def inverse_dynamics(robot: LeggedRobot, q: Array, v: Array, vdot: Array) -> Array:
    """Returns the generalized forces, (N, 6 + J), that a motion takes beside gravity.

    They are M(q) vdot + C(q, v) v - tau_g(q): moments and forces on the base, in the
    world, then the torques of the joints, in N m and N. M includes the rotors. ``q``
    (N, 7 + J) with unit quaternions, ``v`` and ``vdot`` (N, 6 + J) are in the order of
    the robot's plant.
    """
    plant, context = _plant(robot)
    forces = MultibodyForces(plant)
    result = np.empty_like(v)
    for k in range(len(q)):
        plant.SetPositions(context, q[k])
        plant.SetVelocities(context, v[k])
        plant.CalcForceElementsContribution(context, forces)
        result[k] = plant.CalcInverseDynamics(context, vdot[k], forces)
    return result


@lru_cache(maxsize=4)
def _plant(robot: LeggedRobot) -> tuple[MultibodyPlant, Context]:
    # CalcInverseDynamics uses no contacts, so there is neither ground nor scene graph.
    plant = MultibodyPlant(time_step=0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    return plant, plant.CreateDefaultContext()
