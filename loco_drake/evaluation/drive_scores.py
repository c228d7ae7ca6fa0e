"""How well the robot of a drive followed its commands.

The figures are those of :mod:`.steering`, of samples at which the robot did not lie.
They are computed piece by piece: a piece has one gait, is no longer than a minute, and
ends where the robot is put upright.

A driver's keys change a command in many small steps. Changes less than half a second
apart count as one, which begins with the first. Its latency counts if it is .2 m/s or
rad/s at least, and the next one comes 1 s later or more.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.driving import COMMAND, RESET, OrderTable
from loco_drake.control.plan import PLAN_DT
from loco_drake.evaluation.driving import Driven
from loco_drake.evaluation.steering import rmse, robot_latency, stride_velocity
from loco_drake.models.robots import Robot

_LONGEST = 60.0  # s of a piece
_TOGETHER, _APART = 0.5, 1.0  # s between changes
_SMALLEST = 0.2  # m/s or rad/s


def drive_scores(robot: Robot, driven: Driven) -> dict[str, float | None]:
    """Returns the figures by name; None for a latency without a step that counts."""
    state, table = driven.rollout.state, driven.table
    samples = np.arange(len(state))
    commands = table.rows[table.index(PLAN_DT * samples.astype(float))][COMMAND]
    velocity = np.full((len(state), 3), np.nan)
    for first, end in _pieces(driven, len(state)):
        velocity[first:end] = stride_velocity(robot, state[first:end])
    counted = np.isfinite(velocity[:, 0]) & ~np.isin(samples, driven.lying)
    velocity_rmse, yaw_rate_rmse = (
        rmse([(velocity - commands)[counted]]) if counted.any() else (None, None)
    )
    latencies = [
        robot_latency(velocity[:end], before, after, changed)
        for changed, end, before, after in _steps(table, len(state))
        if counted[changed:end].all()
    ]
    known = [latency for latency in latencies if latency is not None]
    return {
        "velocity_rmse_mps": velocity_rmse,
        "yaw_rate_rmse_radps": yaw_rate_rmse,
        "latency_reference_s": max(driven.latencies, default=None),
        "latency_robot_s": float(np.median(known)) if known else None,
    }


def _pieces(driven: Driven, samples: int) -> Iterator[tuple[int, int]]:
    """Yields first and last sample (exclusive) of the pieces of 2 samples or more."""
    table = driven.table
    at = np.round(table.times / PLAN_DT).astype(int)
    gaits = 1 + np.flatnonzero(np.diff(driven.gaits))
    # The robot is put upright after the sample that ends the control period.
    upright = at[table.rows[:, RESET] == 1] + 2
    minutes = np.arange(0, samples, round(_LONGEST / PLAN_DT))
    ends = np.unique(np.concatenate((minutes, gaits, upright, [samples])))
    ends = ends[ends <= samples]
    for first, end in pairwise(ends):
        if end - first >= 2:
            yield int(first), int(end)


def _steps(table: OrderTable, samples: int) -> Iterator[tuple[int, int, Array, Array]]:
    """Yields the steps of the command that count.

    Each is the first sample of it, the first of the next step, and the command before
    and after it, shape (3,).
    """
    at = np.round(table.times / PLAN_DT).astype(int)
    commands = table.rows[COMMAND]
    changes = 1 + np.flatnonzero((np.diff(commands, axis=0) != 0).any(axis=1))
    together = np.diff(at[changes]) < _TOGETHER / PLAN_DT
    for group in np.split(changes, 1 + np.flatnonzero(~together)):
        if not len(group):
            continue
        before, after = commands[group[0] - 1], commands[group[-1]]
        later = changes[changes > group[-1]]
        end = int(at[later[0]]) if len(later) else samples
        lasts = (end - at[group[-1]]) * PLAN_DT >= _APART
        if lasts and np.linalg.norm(after - before) >= _SMALLEST:
            yield int(at[group[0]]), end, before, after
