"""In what an episode's world differs from the model.

Domain randomization (Tobin et al. 2017; Tan et al. 2018, "Sim-to-real") draws a domain
for each episode; :mod:`loco_drake.systems.domain` sets it in a Context.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Push:
    """A constant force on the trunk, at its origin.

    Attributes:
        start: context time, s.
        duration: s.
        force_W: N, shape (3,).
    """

    start: float
    duration: float
    force_W: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorErrors:
    """What is wrong with the measured state; the order is that of :mod:`.measurement`.

    Attributes:
        bias: constant errors, shape (ERROR_SIZE,).
        white: standard deviations of errors that are independent from one sample to
            the next, shape (ERROR_SIZE,).
        seed: of the latter.
    """

    bias: Array
    white: Array
    seed: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Domain:
    """One world; whatever is not given is as in the model.

    Like a Plan it is immutable, and a copy of it is the same object.

    Attributes:
        friction: Coulomb coefficient of the ground; a contact has the harmonic mean of
            this and the feet's.
        stiffness: of the ground in N/m, in series with that of the feet.
        payload: mass added to the trunk, kg.
        com_shift: of the trunk's centre of mass, in B, m, shape (3,).
        strength: torque of each motor over that of its model, for the same set-point
            and state, shape (12,).
        latency: from the choice of a set-point to its effect on the motors, s; whole
            steps of the physics.
        pushes: in any order; where they overlap, forces add up.
        sensors: errors of what the robot measures.
    """

    friction: float | None = None
    stiffness: float | None = None
    payload: float | None = None
    com_shift: Array | None = None
    strength: Array | None = None
    latency: float = 0.0
    pushes: tuple[Push, ...] = ()
    sensors: SensorErrors | None = None

    def needs(self, name: str) -> bool:
        """Returns whether it takes the disturbing system of this name."""
        if name == "actuation":
            return self.strength is not None or self.latency > 0
        return bool(self.pushes) if name == "pushes" else self.sensors is not None

    def __copy__(self) -> "Domain":
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> "Domain":
        return self
