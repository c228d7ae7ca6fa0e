"""How the world of an episode, and what is measured of it, differ from the model.

Domain randomization (Tobin et al. 2017; Tan et al. 2018, "Sim-to-real") draws a Domain
for each episode; :mod:`loco_drake.systems.domain` sets it in a Context.
"""

from dataclasses import dataclass, fields
from math import inf
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array, read_only
from loco_drake.common.errors import InputError, check_number
from loco_drake.common.immutable import Immutable
from loco_drake.common.rotations import quat_exp, quat_multiply, quat_rotate
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    JOINT_VELOCITIES,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
    split,
)
from loco_drake.control.terrain import Terrain
from loco_drake.models.robot import LEAST_PAYLOAD

MAX_LATENCY = 0.1  # s
# Name and size of each part of a sensor error, in order.
ERROR_LAYOUT = (
    ("orientation", 3),  # rotation vector in B, rad
    ("position", 3),  # of the base in the world, m
    ("joint_positions", 12),  # rad
    ("angular_velocity", 3),  # of the base, in B, rad/s
    ("velocity", 3),  # of the base, in B, m/s
    ("joint_velocities", 12),  # rad/s
)
ERROR_SIZE = sum(size for _, size in ERROR_LAYOUT)

# Bounds of the numeric fields of a Domain.
BOUNDS = {
    "friction": (1e-3, inf),
    "stiffness": (1.0, inf),
    "payload": (LEAST_PAYLOAD, inf),
    "com_shift": (-0.2, 0.2),
    "strength": (0.5, 1.5),
    "latency": (0.0, MAX_LATENCY),
    "damping": (0.5, 2.0),
    "joint_friction": (0.0, 0.5),
}


class _Checked:
    """A dataclass that checks its numbers and stores read-only copies of its arrays."""

    def _check(self, what: str, shapes: dict[str, int], **bounds: Any) -> None:
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            name = f"The {what}'s {field.name}"
            if value is None or field.name not in {*shapes, *bounds}:
                continue
            low, high = bounds.get(field.name, (-inf, inf))
            if field.name not in shapes:
                check_number(name, value, low, high)
                continue
            try:
                array = np.array(value, dtype=np.float64)
            except (TypeError, ValueError, OverflowError):
                array = np.zeros(0)
            size = shapes[field.name]
            inside = np.isfinite(array) & (low <= array) & (array <= high)
            if array.shape != (size,) or not inside.all():
                between = "" if low == -inf else f" from {low:g} to {high:g}"
                raise InputError(f"{name} must be {size} finite numbers{between}.")
            object.__setattr__(self, field.name, read_only(array))


@dataclass(frozen=True, eq=False, kw_only=True)
class Push(_Checked):
    """A constant force at the trunk's origin."""

    start: float  # Context time, s
    duration: float  # s
    force_W: Array  # force in W, N, shape (3,)

    def __post_init__(self) -> None:
        self._check("push", {"force_W": 3}, start=(0.0, inf), duration=(0.0, inf))


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorErrors(_Checked):
    """Errors of the measured state, in the order of :data:`ERROR_LAYOUT`."""

    bias: Array  # constant errors, shape (ERROR_SIZE,)
    white: Array  # standard deviations of the white noise, shape (ERROR_SIZE,)
    seed: int  # seed of the white noise

    def __post_init__(self) -> None:
        sizes = {"bias": ERROR_SIZE, "white": ERROR_SIZE}
        self._check("sensor errors", sizes, white=(0.0, inf), seed=(0, inf))


@dataclass(frozen=True, eq=False, kw_only=True)
class Domain(_Checked, Immutable):
    """The parameters of one world; those that are not given are as in the model.

    Raises:
        InputError: if a number is not within :data:`BOUNDS`.
    """

    # Coulomb coefficient of the ground; a contact uses the harmonic mean of this and
    # the feet's.
    friction: float | None = None
    # Stiffness of the ground, N/m, in series with that of the feet.
    stiffness: float | None = None
    payload: float | None = None  # mass added to the trunk, kg
    com_shift: Array | None = None  # of the trunk's centre of mass in B, m, shape (3,)
    # Torque of each motor over its model's at equal set-point and state, shape (12,).
    strength: Array | None = None
    # Delay of the set-points, s, rounded to whole steps of the plant.
    latency: float = 0.0
    # Damping of each motor over its model's, at equal strength.
    damping: float | None = None
    joint_friction: float = 0.0  # Coulomb friction of each joint, N m
    terrain: Terrain | None = None  # ground that is not level
    pushes: tuple[Push, ...] = ()  # in any order; overlapping forces add up
    sensors: SensorErrors | None = None  # errors of the measured state

    def __post_init__(self) -> None:
        self._check("domain", {"com_shift": 3, "strength": 12}, **BOUNDS)

    def needs(self, name: str) -> bool:
        """Returns whether this domain requires the disturbance ``name``."""
        if name == "actuation":
            motors = self.strength is not None or self.damping is not None
            return motors or self.latency > 0 or self.joint_friction > 0
        if name == "terrain":
            return self.terrain is not None
        return bool(self.pushes) if name == "pushes" else self.sensors is not None


def error_vector(**sizes: float) -> Array:
    """Returns an error (ERROR_SIZE,) with the named parts set and all others 0."""
    unknown = sizes.keys() - dict(ERROR_LAYOUT).keys()
    if unknown:
        raise TypeError(f"errors have no part {', '.join(sorted(unknown))}")
    return np.concatenate(
        [np.full(size, sizes.get(name, 0.0)) for name, size in ERROR_LAYOUT]
    )


def draw_error(errors: SensorErrors, sample: int) -> Array:
    """Returns the error (ERROR_SIZE,) of one sample of the clock, deterministically."""
    random = np.random.default_rng((errors.seed, sample))
    return errors.bias + errors.white * random.standard_normal(ERROR_SIZE)


def measure(state: Array, error: Array) -> Array:
    """Returns measured states for states [q, v] (..., 37), errors (..., ERROR_SIZE).

    The observation is computed from the measured state, so an encoder error affects
    every part that depends on it.
    """
    ends = np.cumsum([size for _, size in ERROR_LAYOUT])
    rotation, position, joints, w_B, v_B, joint_velocities = np.split(
        error, ends[:-1], axis=-1
    )
    measured = state.copy()
    q, v = split(measured)
    q_WB = state[ORIENTATION]
    q[ORIENTATION] = quat_multiply(q_WB, quat_exp(rotation))
    q[POSITION] += position
    q[JOINTS] += joints
    v[ANGULAR_VELOCITY] += quat_rotate(q_WB, w_B)
    v[VELOCITY] += quat_rotate(q_WB, v_B)
    v[JOINT_VELOCITIES] += joint_velocities
    return measured
