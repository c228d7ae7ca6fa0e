"""The commands by which steering is measured, and what came of one."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.command import ANY_COMMAND, CommandRange
from loco_drake.evaluation.steering import rmse
from loco_drake.motion.gaits import parse_label

VELOCITY_GOAL, YAW_RATE_GOAL = 0.11, 0.12  # m/s, rad/s
DISTANCE_GOAL = 0.5  # m, largest distance of the robot from its plan

# At least so much of an axis is worth a point, m/s or rad/s.
LEAST = 0.02

# Gaits to change to: by diagonal pairs, by front and rear pairs, one foot at a time.
_OTHERS = ("dog-trot", "mpc-bound", "horse-walk")


@dataclass(frozen=True)
class Course:
    """What to measure of a label."""

    label: str
    seeds: Sequence[int]  # of the drives; the first is that of the rest
    range: CommandRange | None = None  # None to search for it


@dataclass(frozen=True)
class Point:
    """The result of one command."""

    command: Array  # shape (3,)
    velocities: Array  # over a stride, of the samples that count, shape (N, 3)
    normalized_return: float
    cost_of_transport: float
    fell: bool

    @property
    def errors(self) -> Array:
        """Difference of the velocities from the command, shape (N, 3)."""
        return self.velocities - self.command

    @property
    def velocity(self) -> list[float] | None:
        """Mean velocity, shape (3,), or None if the robot fell before it counts."""
        if not len(self.velocities):
            return None
        mean: list[float] = self.velocities.mean(axis=0).tolist()
        return mean

    @property
    def is_good(self) -> bool:
        """Whether the robot stands and keeps the goals."""
        return not self.fell and keeps_goals([self.errors])


def keeps_goals(errors: Sequence[Array]) -> bool:
    """Returns whether errors (N, 3) of points are within the goals, all together."""
    velocity, yaw_rate = rmse(errors)
    if velocity is None or yaw_rate is None:
        return False
    return velocity <= VELOCITY_GOAL and yaw_rate <= YAW_RATE_GOAL


def axis_points(within: CommandRange) -> list[Array]:
    """Returns the command in the middle and four others on each axis that is wide."""
    low, high, middle = np.array(within.low), np.array(within.high), within.middle
    wide = high - low > LEAST
    points = [middle]
    for axis in np.flatnonzero(wide):
        for share in (0.0, 0.25, 0.75, 1.0):
            point = middle.copy()
            point[axis] = low[axis] + share * (high[axis] - low[axis])
            points.append(point)
    return points


def grid(within: CommandRange) -> list[Array]:
    """Returns the commands of the grid: the middle, points on the axes, the corners."""
    low, high, middle = np.array(within.low), np.array(within.high), within.middle
    wide = high - low > LEAST
    sides = [
        (low[axis], high[axis]) if wide[axis] else (middle[axis],) for axis in range(3)
    ]
    corners = [np.array(corner) for corner in itertools.product(*sides)]
    return axis_points(within) + corners


def steps(within: CommandRange) -> Iterator[tuple[Array, Array]]:
    """Yields the commands before and after each step."""
    middle = within.middle
    for axis, end in itertools.product((0, 2), (within.low, within.high)):
        there = middle.copy()
        there[axis] = end[axis]
        if abs(there[axis] - middle[axis]) >= LEAST:
            yield middle, there
            yield there, middle


def gait_changes(
    label: str, within: CommandRange, published: Mapping[int, CommandRange]
) -> Iterator[tuple[int, Array]]:
    """Yields gait, an index into LABELS, and command of each part of a drive.

    It leads to other gaits and back, at the middle of the label's range, or as much of
    that as the range of each other gait holds.
    """
    own = parse_label(label).index
    yield own, within.middle
    for other in map(parse_label, _OTHERS):
        if other.index != own:
            theirs = published.get(other.index, ANY_COMMAND)
            yield other.index, theirs.clip(within.middle)
            yield own, within.middle
