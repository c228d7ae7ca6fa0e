"""Velocity commands: forward and sideways m/s and yaw rate rad/s, in the heading frame.

The heading frame has the heading of the base and its z axis up.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError

AXES = ("forward_mps", "sideways_mps", "yaw_rate_radps")


@dataclass(frozen=True)
class CommandRange:
    """A box of commands."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def middle(self) -> Array:
        """The command in the middle, shape (3,)."""
        return (np.array(self.low) + np.array(self.high)) / 2

    def clip(self, command: Array) -> Array:
        """Returns the nearest command of the box, shape (3,)."""
        return np.clip(command, self.low, self.high)

    def scaled(self, shares: Sequence[float]) -> "CommandRange":
        """Returns the box with its sides shortened about the middle, to hundredths.

        Args:
            shares: share of each side that remains, shape (3,).
        """
        half = np.array(shares) * (np.array(self.high) - self.middle)
        low = np.ceil(np.round(100 * (self.middle - half), 6)) / 100
        high = np.floor(np.round(100 * (self.middle + half), 6)) / 100
        return CommandRange(tuple(low.tolist()), tuple(high.tolist()))

    def figures(self) -> dict[str, list[float]]:
        """Returns lowest and highest value of each axis by name."""
        ends = zip(self.low, self.high, strict=True)
        return {axis: list(pair) for axis, pair in zip(AXES, ends, strict=True)}

    @classmethod
    def of_figures(cls, figures: dict[str, list[float]]) -> Self:
        """Returns the box that :meth:`figures` described."""
        low, high = zip(*(figures[axis] for axis in AXES), strict=True)
        return cls(low, high)


# No command beyond these is followed; most gaits end far below.
ANY_COMMAND = CommandRange((-4.0, -2.0, -4.0), (4.0, 2.0, 4.0))


def check_finite(command: Array) -> None:
    """Raises InputError unless the command (3,) is finite."""
    if not np.isfinite(command).all():
        raise InputError(
            "A command must be three finite numbers: forward and sideways m/s and yaw "
            f"rate rad/s; not {', '.join(f'{value:g}' for value in command)}."
        )
