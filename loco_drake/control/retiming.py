"""TOPP-RA along a plan, which slows it to the limits and never speeds it up."""

from dataclasses import dataclass, replace

import numpy as np
import toppra
from scipy.interpolate import CubicSpline
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint
from toppra.interpolator import AbstractGeometricPath

from loco_drake.common.arrays import Array
from loco_drake.common.gravity import GRAVITY
from loco_drake.common.immutable import Immutable
from loco_drake.control.plan import (
    PLAN_DT,
    Plan,
    first_change,
    join_plans,
    make_plan,
    standing_plan,
)
from loco_drake.control.resampling import positions_at
from loco_drake.control.state import HEIGHT, JOINTS
from loco_drake.models.robots import Robot

# toppra logs infeasible problems as errors; here they are results.
toppra.setup_logging("ERROR")

GROUNDED_FALL = 2.0  # g, of the trunk

# The path clock takes at least this long, in s, to slow from full speed to rest. It
# decelerates the whole robot, which cannot brake in the air, nor on the ground beyond
# friction.
_CLOCK_STOP_TIME = 0.5


@dataclass(frozen=True)
class PathLimits:
    """Limits of each coordinate of a path."""

    speed: Array  # in both directions, shape (D,)
    acceleration: Array  # lower and upper, shape (D, 2)


def fall_limit(grounded: bool) -> float:
    """Returns the ``fall`` of :func:`path_limits` for motion, grounded or not."""
    return GROUNDED_FALL if grounded else 1.0


def path_limits(robot: Robot, fall: float = 1.0) -> PathLimits:
    """Returns the robot's limits on its joints (rad) and the height of its base (m).

    A joint can accelerate its leg by at most ``effort_limit / joint_inertia``. This
    bound applies to a leg in swing, where fast motion happens. A leg in stance also
    carries load, but hardly accelerates.

    The base cannot accelerate downward faster than gravity, since feet push but do not
    pull. Motion of something smaller than this robot violates this limit in flight;
    slowed until it satisfies the limit, it can be tracked.

    Grounded motion needs a ``fall`` of :data:`GROUNDED_FALL`, in g: its centre of mass
    falls as it should, but legs that are drawn up push the trunk down, and a spline
    through samples overshoots where forces end at once.
    """
    joints = robot.effort_limits / robot.joint_inertia
    return PathLimits(
        speed=np.append(robot.joint_speed_limits, np.inf),
        acceleration=np.append(
            np.stack((-joints, joints), axis=1), [[-fall * GRAVITY, np.inf]], axis=0
        ),
    )


class _ClockedPath(AbstractGeometricPath):
    """Coordinates over plan time, with plan time itself as the last coordinate.

    A limit of 1 on the speed of this last coordinate prevents TOPP-RA, which is
    time-optimal, from playing the plan faster than it is.
    """

    def __init__(self, spline: CubicSpline, interval: Array) -> None:
        self._spline = spline
        self._interval = interval

    def __call__(self, path_positions: float | Array, order: int = 0) -> Array:
        s = np.asarray(path_positions, dtype=np.float64)
        clock = (s, np.ones_like(s), np.zeros_like(s))[order]
        return np.concatenate((self._spline(s, order), clock[..., None]), axis=-1)

    @property
    def dof(self) -> int:
        return int(self._spline.c.shape[-1]) + 1

    @property
    def path_interval(self) -> Array:
        return self._interval


class _FreeEndTOPPRA(TOPPRA):
    """TOPP-RA that may end at any speed up to ``sd_end``."""

    def compute_controllable_sets(self, sdmin: float, sdmax: float) -> Array:
        return super().compute_controllable_sets(0.0, sdmax)


@dataclass(frozen=True)
class Clock:
    """Progress along the plan, sampled every PLAN_DT of real time."""

    path_time: Array  # plan time s in s, shape (N,)
    rate: Array  # ds/dt, at most 1, shape (N,)


def retime(
    times: Array,
    waypoints: Array,
    limits: PathLimits,
    *,
    start: float,
    end: float,
    commit: float,
    start_rate: float = 1.0,
) -> Clock:
    """Re-times the path through ``waypoints`` to satisfy ``limits``.

    A feasible plan is left exactly unchanged. Otherwise TOPP-RA (Pham and Pham 2018)
    finds the fastest clock that is never faster than the plan.

    Args:
        times: plan times of the waypoints, s, shape (N,). They may extend beyond
            ``start`` and ``end``, which makes the spline independent of both.
        waypoints: coordinates at these times, shape (N, D).
        limits: limits to satisfy from ``start`` to ``end``.
        start: plan time, s.
        end: plan time, s.
        commit: plan time of the clock's end, s. The rest, up to ``end``, ensures that
            the motion can continue.
        start_rate: ds/dt at ``start``; lowered if it makes the limits infeasible.
    """
    spline = CubicSpline(times, waypoints)
    count = max(2, round((end - start) / (0.5 * PLAN_DT)))
    grid = np.linspace(start, end, count + 1)
    if start_rate > 1 - 1e-6 and _feasible(spline, grid, limits):
        steps = int(np.floor((commit - start) / PLAN_DT + 1e-6))
        return _aligned(spline, start, steps, limits)
    rates = _solve(spline, grid, limits, start_rate)
    return _sample(grid, rates, commit)


def _aligned(
    spline: CubicSpline, start: float, steps: int, limits: PathLimits
) -> Clock:
    """Returns a clock at full speed that gets back to the plan's own samples.

    What is played between samples is interpolated, so feet that stand slip. A clock
    that was slowed waits for the next sample, if joints and base can.
    """
    elapsed = PLAN_DT * np.arange(steps + 1, dtype=np.float64)
    full = Clock(start + elapsed, np.ones(steps + 1))
    wait = float((start - spline.x[0]) % PLAN_DT)
    if min(wait, PLAN_DT - wait) < 1e-6 * PLAN_DT or not steps:
        return full
    duration = steps * PLAN_DT
    turn = 2 * np.pi * elapsed / duration
    path_time = start + elapsed - wait * (turn - np.sin(turn)) / (2 * np.pi)
    rate = 1 - wait / duration * (1 - np.cos(turn))
    slowing = -2 * np.pi * wait / duration**2 * np.sin(turn)
    lower, upper = limits.acceleration.T
    acceleration = (
        spline(path_time, 2) * rate[:, None] ** 2
        + spline(path_time, 1) * slowing[:, None]
    )
    possible = (lower <= acceleration) & (acceleration <= upper)
    gentle = np.abs(slowing) <= 1 / _CLOCK_STOP_TIME
    return Clock(path_time, rate) if possible.all() and gentle.all() else full


def _feasible(spline: CubicSpline, grid: Array, limits: PathLimits) -> bool:
    slow = np.abs(spline(grid, 1)) <= limits.speed
    lower, upper = limits.acceleration.T
    acceleration = spline(grid, 2)
    soft = (lower <= acceleration) & (acceleration <= upper)
    return bool(slow.all() and soft.all())


def _solve(
    spline: CubicSpline, grid: Array, limits: PathLimits, start_rate: float
) -> Array:
    """Returns ds/dt at the grid points by TOPP-RA."""
    speed = np.append(limits.speed, 1.0)
    clock = [[-1.0 / _CLOCK_STOP_TIME, 1.0 / _CLOCK_STOP_TIME]]
    constraints = [
        JointVelocityConstraint(np.stack((-speed, speed), axis=1)),
        JointAccelerationConstraint(np.append(limits.acceleration, clock, axis=0)),
    ]
    path = _ClockedPath(spline, grid[[0, -1]])
    solver = _FreeEndTOPPRA(constraints, path, gridpoints=grid, solver_wrapper="seidel")
    controllable = np.sqrt(solver.compute_controllable_sets(0.0, 1.0)[0])
    # If the plan violates the limits at its start, the clock has to jump.
    rate = float(np.clip(start_rate, controllable[0], controllable[1]))
    _, rates, _ = solver.compute_parameterization(rate, 1.0)
    if rates is None or np.isnan(rates).any():
        raise RuntimeError("TOPP-RA found no way to play the plan within its limits")
    return np.asarray(rates)


def _sample(grid: Array, rates: Array, commit: float) -> Clock:
    """Samples the clock at multiples of PLAN_DT; between grid points s̈ is constant."""
    spans = 2 * np.diff(grid) / (rates[1:] + rates[:-1])
    real = np.concatenate(([0.0], np.cumsum(spans)))
    t = PLAN_DT * np.arange(int(np.floor(real[-1] / PLAN_DT + 1e-9)) + 1)
    i = np.clip(np.searchsorted(real, t, side="right") - 1, 0, len(spans) - 1)
    tau = t - real[i]
    acceleration = (rates[i + 1] - rates[i]) / spans[i]
    s = grid[i] + rates[i] * tau + 0.5 * acceleration * tau**2
    rate = rates[i] + acceleration * tau
    keep = s <= commit + 1e-9
    return Clock(s[keep], np.minimum(rate[keep], 1.0))


@dataclass(frozen=True, eq=False)
class Progress(Immutable):
    """The state of re-timing a plan."""

    plan: Plan  # the re-timed plan
    rate: Array  # ds/dt of each of its samples, shape (N,)
    source: Plan | None = None  # the plan that was re-timed; None at first

    @property
    def path_time(self) -> float:
        """Plan time of the last sample, s."""
        return float(self.plan.path_time[-1])

    def slice(self, first: int, end: int | None = None) -> "Progress":
        """Returns the samples from ``first`` on, up to ``end`` (exclusive)."""
        return replace(
            self, plan=self.plan.slice(first, end), rate=self.rate[first:end]
        )

    def before_change(self, raw: Plan) -> "Progress":
        """Returns the samples before the first one that differs in ``raw``.

        If all do, ``raw`` is another motion, and the result has no source.
        """
        if self.source is None or raw is self.source:
            return self
        change = first_change(self.source, raw)
        if self.path_time < change:
            return self
        end = int(np.searchsorted(self.plan.path_time, change))
        return self.slice(0, end) if end else replace(self, source=None)


def no_progress(robot: Robot, start_time: float) -> Progress:
    """Returns the state before the first chunk, which begins at ``start_time``, s."""
    return Progress(standing_plan(robot, start_time), np.ones(1))


def smooth_chunk(
    robot: Robot, limits: PathLimits, progress: Progress, raw: Plan, chunk: float
) -> Progress | None:
    """Returns ``progress`` extended by one chunk, or None if ``raw`` is too short.

    An open-ended plan must reach two chunks ahead. The last chunk of other plans may be
    shorter.
    """
    begun = progress.source is not None
    start = progress.path_time if begun else float(raw.path_time[0])
    last = float(raw.path_time[-1])
    if last - start < (2 * chunk if raw.open_ended else 2 * PLAN_DT):
        return None
    end = min(start + 2 * chunk, last)
    # With a margin on both sides, the splines of consecutive windows agree.
    margin = 12 * PLAN_DT
    window = slice(
        int(np.searchsorted(raw.path_time, start - margin)),
        int(np.searchsorted(raw.path_time, end + margin, side="right")),
    )
    clock = retime(
        raw.path_time[window],
        np.column_stack((raw.q[window][JOINTS], raw.q[window, HEIGHT])),
        limits,
        start=start,
        end=end,
        commit=min(start + chunk, last),
        start_rate=float(progress.rate[-1]),
    )
    if not begun:
        plan = _follow(robot, raw, window, clock, progress.plan.start_time)
        return Progress(plan, clock.rate, raw)
    # The first sample is the last committed one.
    clock = Clock(clock.path_time[1:], clock.rate[1:])
    if not len(clock.rate):
        return None
    added = _follow(robot, raw, window, clock, progress.plan.end_time + PLAN_DT)
    plan = join_plans(progress.plan, added)
    return Progress(plan, np.concatenate((progress.rate, clock.rate)), raw)


def _follow(robot: Robot, raw: Plan, window: slice, clock: Clock, start: float) -> Plan:
    """Returns ``raw`` played by ``clock``, from Context time ``start``."""
    s = clock.path_time
    times = raw.path_time[window]
    q = positions_at(robot, times, raw.q[window], raw.p_WF[window], s)
    v = np.stack([np.interp(s, times, column) for column in raw.v[window].T], axis=1)
    nearest = window.start + np.clip(
        np.rint((s - times[0]) / PLAN_DT).astype(int), 0, len(times) - 1
    )
    return make_plan(
        robot,
        q=q,
        v=v * clock.rate[:, None],
        contacts=raw.contacts[nearest],
        labels=raw.labels[nearest],
        start_time=start,
        path_time=s,
        open_ended=raw.open_ended,
    )


def smooth_plan(
    robot: Robot, raw: Plan, limits: PathLimits, chunk: float = 0.96
) -> Plan:
    """Returns all of ``raw``, re-timed chunk by chunk as the system does it."""
    progress = no_progress(robot, raw.start_time)
    while (extended := smooth_chunk(robot, limits, progress, raw, chunk)) is not None:
        progress = extended
    return progress.plan
