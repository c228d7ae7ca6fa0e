"""How long a simulated robot takes to change its gait: the definition.

A change begins when the port ``gait`` changes. It is complete at the latest of three
moments:

* The plan has, at the time that is being played, the label of the new gait, for good.
* From then on, the robot's horizontal velocity is within VELOCITY_GOAL of its new
  command for the first time; see :func:`.steering.stride_velocity`.
* The robot's footfalls have covered 90 % of the way to those of the new gait, for the
  first time.

Footfalls are ten shares of a stride, centred at each sample: that in which each foot is
down, and that in which each pair of feet does the same, both down or both up. A foot is
down if its sole is lower than 6 % of the stance height. The old gait's are the mean of
the 2 s before the change, the new gait's that of the last 2 s; where they differ by
less than .1 on average, as those of two trots, they tell nothing and are left out.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.rotations import quat_rotate
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import JOINTS, ORIENTATION, POSITION
from loco_drake.evaluation.steering import stride_of, stride_velocity
from loco_drake.evaluation.steering_courses import VELOCITY_GOAL
from loco_drake.models.robots import Robot

SETTLED = 2.0  # s
_COVERED = 0.9
_ALIKE = 0.1
_DOWN_HEIGHT = 0.06  # stance heights


def gait_change_figures(
    robot: Robot,
    state: Array,
    labels: Integers,
    commands: Sequence[Array],
    period: int,
) -> dict[str, float | None]:
    """Returns the figures of a drive whose gait changes every ``period`` samples.

    Args:
        robot: the robot.
        state: of each sample, shape (N, ...); shorter than the drive if the robot fell.
        labels: label of the plan that is played at each sample, shape (N,).
        commands: of each part of the drive, shape (3,); the first has no change.
        period: SETTLED or more, in samples.
    """
    # Before and after each change; none after a fall.
    parts = [slice(k * period, (k + 2) * period) for k in range(len(commands) - 1)]
    times = [
        gait_change_time(robot, state[part], labels[part], period, command)
        for part, command in zip(parts, commands[1:], strict=True)
        if part.stop < len(state)
    ]
    known = [time for time in times if time is not None]
    return {
        "gait_change_s": float(np.median(known)) if known else None,
        "gait_change_max_s": max(known, default=None),
        "gait_changes": len(parts),
        "gait_changes_completed": len(known),
    }


def gait_change_time(
    robot: Robot, state: Array, labels: Integers, changed: int, command: Array
) -> float | None:
    """Returns the time that a change of gait took in s, None if it never completes.

    Args:
        robot: the robot.
        state: [q, v] or q at each sample, shape (N, ...): from SETTLED or more before
            the change until the new gait has long been reached.
        labels: label of the plan that is played at each sample, shape (N,); the last
            one is that of the new gait.
        changed: the sample at which the port changes.
        command: the command from then on, shape (3,).
    """
    q = state[:, : 7 + len(robot.joint_names)]
    told = int(np.flatnonzero(labels[changed:] != labels[-1]).max(initial=-1)) + 1
    velocity = stride_velocity(robot, q)[changed:]
    off = np.linalg.norm((velocity - command)[:, :2], axis=1)
    moments = [told, told + _first(off[told:] <= VELOCITY_GOAL)]
    settled = round(SETTLED / PLAN_DT)
    falls = footfalls(robot, q, stride_of(robot, q[-2 * settled :]))
    old = falls[max(changed - settled, 0) : changed].mean(axis=0)
    way = falls[-settled:].mean(axis=0) - old
    if np.abs(way).mean() >= _ALIKE:
        covered = (falls[changed:] - old) @ way / (way @ way)
        moments.append(_first(covered >= _COVERED))
    latest = max(moments)
    return latest * PLAN_DT if latest < len(velocity) else None


def footfalls(robot: Robot, q: Array, stride: float) -> Array:
    """Returns the ten shares of a stride at each sample, shape (N, 10).

    Args:
        robot: the robot.
        q: positions at each sample, shape (N, 7 + J).
        stride: its period, s.
    """
    p_BF_W = quat_rotate(q[ORIENTATION][:, None], robot.toe_positions(q[JOINTS]))
    sole = q[POSITION][:, 2:] + p_BF_W[..., 2] - robot.foot_radius
    down = sole < _DOWN_HEIGHT * robot.stand_height
    alike = [down[:, a] == down[:, b] for a, b in combinations(range(4), 2)]
    shares = np.column_stack([down, *alike]).astype(np.float64)
    total = np.concatenate((np.zeros((1, 10)), np.cumsum(shares, axis=0)))
    length = max(1, round(stride / PLAN_DT))
    k = np.arange(len(shares))
    first, last = np.maximum(k - length // 2, 0), k - length // 2 + length
    last = np.minimum(last, len(shares))
    mean: Array = (total[last] - total[first]) / (last - first)[:, None]
    return mean


def _first(true: Array) -> int:
    """Returns the index of the first True, or a very large one if there is none."""
    return int(np.argmax(true)) if true.any() else np.iinfo(np.int64).max // 2
