"""Ground that is not flat and level, and what heights mean on it.

A plan does not know the terrain: its z is a height over level ground. On a terrain the
robot's state is therefore expressed *over the ground*: z is the height of the base over
the mean ground below it, measured vertically, and v_z the rate of this height. Plans,
what the policy observes, rewards, falls and errors of the base then mean what they mean
on level ground. Orientations and all other velocities remain those in the world, so a
trunk that follows the slope differs from its plan by the slope's angle.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from loco_drake.common.arrays import Array, read_only
from loco_drake.common.errors import InputError, check_number
from loco_drake.common.immutable import Immutable
from loco_drake.common.rotations import quat_exp, quat_multiply, quat_rotate
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    HEIGHT,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
    split,
)
from loco_drake.models.simulated import SimulatedRobot

MAX_SLOPE = 30.0  # degrees
MAX_ROUGHNESS = 0.1  # m
MAX_STEP = 0.2  # m

_WAVES = 12  # that the bumps are made of
_WAVELENGTHS = (0.3, 1.2)  # m
# Length over which the mean ground rises at a step: about that between the legs.
_STEP_LENGTH = 0.4  # m


@dataclass(frozen=True, eq=False, kw_only=True)
class Terrain(Immutable):
    """An inclined plane through the world's origin, with bumps, and with a step.

    The bumps are a sum of twelve sine waves of .3 to 1.2 m in random directions, whose
    standard deviation is a quarter of the roughness: 95 % of the ground lies within a
    range of ``roughness``. The step is up, across the world's x axis.

    Raises:
        InputError: if a number is out of its bounds.
    """

    # Rise of the ground per metre along the world's x and y, shape (2,).
    gradient: Array
    roughness: float = 0.0  # height range of the bumps, m
    seed: int = 0  # of the bumps
    step: float = 0.0  # height of the step, m
    step_x: float = 1.0  # where it is, m

    def __post_init__(self) -> None:
        gradient = np.array(self.gradient, dtype=np.float64)
        steepest = np.tan(np.deg2rad(MAX_SLOPE)) + 1e-9
        if gradient.shape != (2,) or not np.linalg.norm(gradient) <= steepest:
            raise InputError(
                "A terrain's gradient must be 2 finite numbers, of a slope of at most "
                f"{MAX_SLOPE:g} degrees."
            )
        object.__setattr__(self, "gradient", read_only(gradient))
        check_number("A terrain's roughness", self.roughness, 0.0, MAX_ROUGHNESS)
        check_number("A terrain's step", self.step, 0.0, MAX_STEP)
        check_number("A terrain's step_x", self.step_x, 0.0, 100.0)

    def surface(self, p: Array) -> tuple[Array, Array]:
        """Returns height and gradient of the ground, but for the step, at points.

        ``p`` is x and y in m, (..., 2); heights are (...) in m, gradients (..., 2).
        """
        height, gradient = p @ self.gradient, np.broadcast_to(self.gradient, p.shape)
        if self.roughness > 0:
            waves, phases, amplitude = self._bumps
            angle = p @ waves + phases
            height = height + amplitude * np.sin(angle).sum(axis=-1)
            gradient = gradient + amplitude * np.cos(angle) @ waves.T
        return height, gradient

    def over_ground(self, state: Array) -> Array:
        """Returns a state [q, v] in the world, (13 + 2 J,), as over the ground."""
        return self._raised(state, -1.0)

    def in_world(self, state: Array) -> Array:
        """Returns a state over the ground, (13 + 2 J,), as in the world."""
        return self._raised(state, 1.0)

    def placed(self, robot: SimulatedRobot, state: Array) -> Array:
        """Returns a state over the ground, (13 + 2 J,), of a robot on the slope.

        The robot of ``state``, which is made for level ground, is turned with the slope
        and moves along it, at the same distance from the plane; on bumps it is raised
        until none is in a foot.
        """
        state = state.copy()
        q, v = split(state)
        turn = self._turn()
        q[ORIENTATION] = quat_multiply(turn, q[ORIENTATION])
        q[HEIGHT] *= np.sqrt(1 + self.gradient @ self.gradient)
        v[ANGULAR_VELOCITY] = quat_rotate(turn, v[ANGULAR_VELOCITY])
        v[VELOCITY] = quat_rotate(turn, v[VELOCITY])
        v[VELOCITY][2] -= self.gradient @ v[VELOCITY][:2]
        if self.roughness > 0:
            toes = toes_in_world(robot, q)[:, :2]
            bumps = self.surface(toes)[0] - toes @ self.gradient
            q[HEIGHT] += max(0.0, bumps.max())
        return state

    @cached_property
    def _bumps(self) -> tuple[Array, Array, float]:
        """Wave vectors, rad/m, (2, W), phases, rad, (W,), and amplitude, m."""
        random = np.random.default_rng(self.seed)
        shortest, longest = np.log(_WAVELENGTHS)
        length = np.exp(random.uniform(shortest, longest, _WAVES))
        angle, phases = random.uniform(-np.pi, np.pi, (2, _WAVES))
        waves = 2 * np.pi / length * np.stack((np.cos(angle), np.sin(angle)))
        return waves, phases, self.roughness / 4 / np.sqrt(_WAVES / 2)

    def _raised(self, state: Array, sign: float) -> Array:
        state = state.copy()
        q, v = split(state)
        p, velocity = q[POSITION], v[VELOCITY]
        p[2] += sign * (self.gradient @ p[:2])
        velocity[2] += sign * (self.gradient @ velocity[:2])
        if self.step > 0:
            climbed = (p[0] - self.step_x) / _STEP_LENGTH + 0.5
            p[2] += sign * self.step * min(max(climbed, 0.0), 1.0)
            if 0 < climbed < 1:
                velocity[2] += sign * self.step / _STEP_LENGTH * velocity[0]
        return state

    def _turn(self) -> Array:
        """Returns the quaternion that turns z to the plane's normal, shape (4,)."""
        steepness = np.linalg.norm(self.gradient)
        if steepness == 0:
            return np.array([1.0, 0.0, 0.0, 0.0])
        x, y = self.gradient / steepness
        return quat_exp(np.arctan(steepness) * np.array([y, -x, 0.0]))


def slope_gradient(degrees: float, direction: float) -> Array:
    """Returns the gradient (2,) of a slope that rises towards ``direction``, rad."""
    rise = np.tan(np.deg2rad(degrees))
    return np.asarray(rise * np.array([np.cos(direction), np.sin(direction)]))


def toes_in_world(robot: SimulatedRobot, q: Array) -> Array:
    """Returns the contact points, m, (4, 3), of positions q, (7 + J,)."""
    return np.asarray(
        q[POSITION] + quat_rotate(q[ORIENTATION], robot.contact_points(q[JOINTS]))
    )
