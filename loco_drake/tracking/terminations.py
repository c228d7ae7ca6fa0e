"""When a training episode ends early."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError


@dataclass(kw_only=True)
class TerminationConfig:
    """How far the robot may be from its plan before an episode ends.

    Joint errors cannot see a robot that stands still while its plan walks off, so the
    base's lag ends episodes too (Bogdanovic et al. 2022 and others).

    Attributes:
        position: distance of the base from the plan's, m.
        rotation: angle of the base from the plan's, rad.
    """

    position: float = 0.35
    rotation: float = 0.8

    def check(self) -> None:
        """Raises InputError unless both are above 0."""
        for name in ("position", "rotation"):
            value = getattr(self, name)
            if not value > 0:
                raise InputError(
                    f"The termination's {name} must be above 0, not {value}."
                )


def has_strayed(
    config: TerminationConfig,
    state: NDArray[np.float64],
    plan_state: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Returns whether each robot is too far from its plan to come back, (...).

    Args:
        config: how far is too far.
        state: the plant's [q, v], shape (..., 37).
        plan_state: the same of the plan.
    """
    gap = np.linalg.norm(state[..., 4:7] - plan_state[..., 4:7], axis=-1)
    # A turn by an angle a takes a unit quaternion to one whose product with it is
    # cos(a / 2), up to its sign.
    product = np.einsum("...i,...i->...", state[..., :4], plan_state[..., :4])
    turn = 2 * np.arccos(np.minimum(np.abs(product), 1.0))
    return (gap > config.position) | (turn > config.rotation)
