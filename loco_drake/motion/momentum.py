"""Momentum of a robot's motion, and what of it no forces of its feet can explain.

With c the centre of mass of all bodies, L their angular momentum about it, h and m the
robot's standing height and mass, a motion obeys physics if forces f of its feet at
their soles p_F exist, within friction and never pulling, so that

    m (c'' - g) = sum f,    L' = sum (p_F - c) x f.

c'' and L' are differences of the positions at neighbouring frames: at frame k
(c_(k+1) - 2 c_k + c_(k-1)) fps^2 and (L_(k+1/2) - L_(k-1/2)) fps, where L_(k+1/2) is
that of the pose halfway, at the velocity from one frame to the next.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from scipy.optimize import nnls

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.gravity import GRAVITY
from loco_drake.common.rotations import quat_error
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import Motion
from loco_drake.motion.quality import toe_trajectories

GRAVITY_W = np.array([0.0, 0.0, -GRAVITY])  # m/s^2

# Of a foot on the ground of the scenarios, the harmonic mean of .8 and .8.
FRICTION = 0.8
_EDGES = 8  # of the pyramid inside a cone of friction


class Momentum(NamedTuple):
    """Momentum over T frames, in the world."""

    com: Array  # centre of mass c, m, shape (T, 3)
    # Angular momentum L about the centre of mass, kg m^2/s, halfway between frames,
    # shape (T - 1, 3).
    angular: Array


class MassModel:
    """The masses of Go2 or A1, as a plant of Drake without ground."""

    def __init__(self, robot: Robot) -> None:
        self._plant = MultibodyPlant(time_step=0.0)
        robot.AddModel(Parser(self._plant))
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self.mass = float(self._plant.CalcTotalMass(self._context))

    def momentum(self, q: Array, fps: float) -> Momentum:
        """Returns the momentum of positions ``q`` (T, 7 + J) in the plant's order."""
        plant, context = self._plant, self._context
        com = np.empty((len(q), 3))
        for k, row in enumerate(q):
            plant.SetPositions(context, row)
            com[k] = plant.CalcCenterOfMassPositionInWorld(context)
        middle, v = halfway(q, fps)
        angular = np.empty((len(v), 3))
        for k, row in enumerate(middle):
            plant.SetPositions(context, row)
            plant.SetVelocities(context, v[k])
            about = plant.CalcCenterOfMassPositionInWorld(context)
            spatial = plant.CalcSpatialMomentumInWorldAboutPoint(context, about)
            angular[k] = spatial.rotational()
        return Momentum(com, angular)

    def momentum_matrices(self, q: Array, directions: Array) -> Array:
        """Returns [L; m c'] per unit of each direction of velocity, (T, 6, N).

        ``directions`` (T, 6 + J, N) are velocities v at the positions ``q`` (T, 7 + J).
        """
        plant, context = self._plant, self._context
        matrices = np.empty((len(q), 6, directions.shape[-1]))
        for k, row in enumerate(q):
            plant.SetPositions(context, row)
            about = plant.CalcCenterOfMassPositionInWorld(context)
            for n, v in enumerate(directions[k].T):
                plant.SetVelocities(context, v)
                spatial = plant.CalcSpatialMomentumInWorldAboutPoint(context, about)
                matrices[k, :3, n] = spatial.rotational()
                matrices[k, 3:, n] = spatial.translational()
        return matrices


@lru_cache(maxsize=2)
def mass_model(robot: Robot) -> MassModel:
    """Returns the robot's :class:`MassModel`; its model is parsed once."""
    return MassModel(robot)


def positions(motion: Motion) -> Array:
    """Returns q = [R_WB as w x y z, p_WB, joints] in the plant's order, (T, 7 + J)."""
    parts = (motion.base_quaternion, motion.base_position, motion.joint_positions)
    return np.hstack(parts)


def halfway(q: Array, fps: float) -> tuple[Array, Array]:
    """Returns the poses between frames, (T - 1, 7 + J), and v there, (T - 1, 6 + J)."""
    middle = (q[1:] + q[:-1]) / 2
    middle[:, :4] /= np.linalg.norm(middle[:, :4], axis=1, keepdims=True)
    turn = quat_error(q[:-1, :4], q[1:, :4])
    return middle, fps * np.hstack((turn, np.diff(q[:, 4:], axis=0)))


def wrench(momentum: Momentum, mass: float, fps: float) -> Array:
    """Returns [L', m (c'' - g)] in N m and N at the frames 1 to T - 2, (T - 2, 6)."""
    force = mass * (np.diff(momentum.com, 2, axis=0) * fps**2 - GRAVITY_W)
    return np.hstack((np.diff(momentum.angular, axis=0) * fps, force))


def free_fall_error(motion: Motion, robot: Robot) -> float | None:
    """Returns the RMS of |c'' - g| in m/s^2 where no foot is planned to stand.

    These are the frames without contact, except for the first and the last of the
    motion; None if there are none.
    """
    model = mass_model(robot)
    com = model.momentum(positions(motion), motion.fps).com
    fall = np.diff(com, 2, axis=0) * motion.fps**2 - GRAVITY_W
    flight = ~motion.contacts[1:-1].any(axis=1)
    if not flight.any():
        return None
    return float(np.sqrt((fall[flight] ** 2).sum(axis=1).mean()))


def momentum_error(motion: Motion, robot: Robot) -> float:
    """Returns the part of the motion's wrench that no forces of its feet can give.

    In each frame the forces of the feet in contact are those that come nearest to the
    wrench [L' / (m g h), (c'' - g) / g], within a pyramid of eight edges inside the
    cone of friction .8. The error is the RMS over frames of the length of what remains:
    1 is a missing force of the robot's weight, or a moment of its weight at the
    distance of its standing height.
    """
    remains = missing_wrench(motion, robot)
    return float(np.sqrt((remains**2).sum(axis=1).mean()))


def missing_wrench(motion: Motion, robot: Robot) -> Array:
    """Returns what remains in each frame, see :func:`momentum_error`, (T - 2, 6).

    The moment comes first, then the force.
    """
    model = mass_model(robot)
    momentum = model.momentum(positions(motion), motion.fps)
    weight = model.mass * GRAVITY
    scale = weight * np.array([robot.stand_height] * 3 + [1.0] * 3)
    needed = wrench(momentum, model.mass, motion.fps) / scale
    soles = toe_trajectories(motion, robot) - [0.0, 0.0, robot.foot_radius]
    arms = (soles - momentum.com[:, None])[1:-1] / robot.stand_height
    contacts: Bools = motion.contacts[1:-1]
    turn = 2 * np.pi * np.arange(_EDGES) / _EDGES
    edges = np.stack(
        (FRICTION * np.cos(turn), FRICTION * np.sin(turn), np.ones(_EDGES)), axis=1
    )
    remains = needed.copy()
    for k in np.flatnonzero(contacts.any(axis=1)):
        moments = np.cross(arms[k, contacts[k]][:, None], edges)
        forces = np.broadcast_to(edges, moments.shape)
        generators = np.concatenate((moments, forces), axis=-1).reshape(-1, 6).T
        share, _ = nnls(generators, needed[k])
        remains[k] = needed[k] - generators @ share
    return remains
