"""Ground that is not flat and level, and what heights mean on it.

A plan does not know the terrain: its z is a height over level ground. On a terrain the
robot's state is therefore expressed *over the ground*: z is the height of the base over
the ground below it, measured vertically, and v_z the rate of this height. Plans, what
the policy observes, rewards, falls and errors of the base then mean what they mean on
level ground. Orientations and all other velocities remain those in the world, so a
trunk that follows the slope differs from its plan by the slope's angle.
"""

from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array, read_only
from loco_drake.common.errors import InputError
from loco_drake.common.immutable import Immutable
from loco_drake.common.rotations import quat_exp, quat_multiply, quat_rotate
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    HEIGHT,
    ORIENTATION,
    POSITION,
    VELOCITY,
    split,
)

MAX_SLOPE = 30.0  # degrees


@dataclass(frozen=True, eq=False, kw_only=True)
class Terrain(Immutable):
    """An inclined plane through the world's origin.

    Raises:
        InputError: if the plane is steeper than :data:`MAX_SLOPE`.
    """

    # Rise of the ground per metre along the world's x and y, shape (2,).
    gradient: Array

    def __post_init__(self) -> None:
        gradient = np.array(self.gradient, dtype=np.float64)
        steepest = np.tan(np.deg2rad(MAX_SLOPE)) + 1e-9
        if gradient.shape != (2,) or not np.linalg.norm(gradient) <= steepest:
            raise InputError(
                "A terrain's gradient must be 2 finite numbers, of a slope of at most "
                f"{MAX_SLOPE:g} degrees."
            )
        object.__setattr__(self, "gradient", read_only(gradient))

    def over_ground(self, state: Array) -> Array:
        """Returns a state [q, v] in the world, (37,), as over the ground."""
        return self._raised(state, -1.0)

    def in_world(self, state: Array) -> Array:
        """Returns a state over the ground, (37,), as in the world."""
        return self._raised(state, 1.0)

    def placed(self, state: Array) -> Array:
        """Returns a state over the ground, (37,), of a robot that stands on the slope.

        The robot of ``state``, which is made for level ground, is turned with the slope
        and moves along it, at the same distance from the plane.
        """
        state = state.copy()
        q, v = split(state)
        turn = self._turn()
        q[ORIENTATION] = quat_multiply(turn, q[ORIENTATION])
        q[HEIGHT] *= np.sqrt(1 + self.gradient @ self.gradient)
        v[ANGULAR_VELOCITY] = quat_rotate(turn, v[ANGULAR_VELOCITY])
        v[VELOCITY] = quat_rotate(turn, v[VELOCITY])
        v[VELOCITY][2] -= self.gradient @ v[VELOCITY][:2]
        return state

    def _raised(self, state: Array, sign: float) -> Array:
        state = state.copy()
        q, v = split(state)
        q[HEIGHT] += sign * (self.gradient @ q[POSITION][:2])
        v[VELOCITY][2] += sign * (self.gradient @ v[VELOCITY][:2])
        return state

    def _turn(self) -> Array:
        """Returns the quaternion that turns z to the plane's normal, shape (4,)."""
        steepness = np.linalg.norm(self.gradient)
        if steepness == 0:
            return np.array([1.0, 0.0, 0.0, 0.0])
        x, y = self.gradient / steepness
        return quat_exp(np.arctan(steepness) * np.array([y, -x, 0.0]))


def slope(degrees: float, direction: float) -> Terrain:
    """Returns a plane of so many degrees that rises towards ``direction``, rad."""
    rise = np.tan(np.deg2rad(degrees))
    return Terrain(gradient=rise * np.array([np.cos(direction), np.sin(direction)]))
