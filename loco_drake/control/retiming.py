"""TOPP-RA along a plan: slow down where the actuators cannot follow, never speed up."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import toppra
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint
from toppra.interpolator import AbstractGeometricPath

from loco_drake.common.rotations import quat_continuous
from loco_drake.control.action import GRAVITY
from loco_drake.control.plan import (
    PLAN_DT,
    Plan,
    join_plans,
    make_plan,
    standing_plan,
)
from loco_drake.control.state import HEIGHT, JOINTS, ORIENTATION
from loco_drake.models.robots import Robot

Array = NDArray[np.float64]

# toppra tells of infeasible problems through its logger; here they are results.
toppra.setup_logging("ERROR")

# The path clock may slow from full speed to rest in no less than this many seconds:
# what it does to the plan's speed is done to the whole robot, which is in the air at
# times, and on the ground brakes at no more than friction allows.
_CLOCK_STOP_TIME = 0.5


@dataclass(frozen=True)
class PathLimits:
    """What each coordinate of a path can do.

    Attributes:
        speed: at most this, in both directions, shape (D,).
        acceleration: from the first to the second, shape (D, 2).
    """

    speed: Array
    acceleration: Array


def path_limits(robot: Robot) -> PathLimits:
    """Returns the robot's limits on its joints (rad) and the height of its base (m).

    The acceleration that a joint can give its leg is ``effort_limit /
    joint_inertia``: an upper bound for a leg in swing, where fast joint
    motion happens. A leg in stance also carries load, but hardly accelerates.

    The base cannot fall faster than gravity makes it, since feet push but do not
    pull. Motion of an animal or robot smaller than this one asks for that where all
    feet are in the air; slowed until it falls like any body, it can be followed.
    """
    joints = robot.effort_limits / robot.joint_inertia
    return PathLimits(
        speed=np.append(robot.joint_speed_limits, np.inf),
        acceleration=np.append(
            np.stack((-joints, joints), axis=1), [[-GRAVITY, np.inf]], axis=0
        ),
    )


class _ClockedPath(AbstractGeometricPath):
    """Coordinates over plan time, and plan time itself as the last of them.

    Limiting the speed of that last coordinate to 1 is what keeps TOPP-RA, which is
    time-optimal, from playing the plan faster than it was written.
    """

    def __init__(self, spline: CubicSpline, start: float, end: float) -> None:
        self._spline = spline
        self._interval = np.array([start, end])

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

    @property
    def waypoints(self) -> tuple[Array, Array]:
        return self._interval, self(self._interval)


class _FreeEndTOPPRA(TOPPRA):
    """TOPP-RA that may end at any speed up to ``sd_end``, not at ``sd_end`` itself."""

    def compute_controllable_sets(self, sdmin: float, sdmax: float) -> Array:
        return super().compute_controllable_sets(0.0, sdmax)


@dataclass(frozen=True)
class Clock:
    """Progress along the plan, sampled every PLAN_DT of real time.

    Attributes:
        path_time: plan time s in s, shape (N,).
        rate: ds/dt, at most 1, shape (N,).
    """

    path_time: Array
    rate: Array


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
    """Re-times the path through ``waypoints`` so that it keeps within ``limits``.

    Where the plan is feasible as written it is left exactly alone. Otherwise TOPP-RA
    (Pham and Pham 2018) finds the fastest clock that is never faster than the plan.

    Args:
        times: plan times of the waypoints in s, shape (N,); may reach beyond
            ``start`` and ``end``, which makes the spline independent of both.
        waypoints: coordinates there, shape (N, D).
        limits: what must hold.
        start: plan time at which to start.
        end: plan time up to which the limits are to be satisfied.
        commit: plan time at which to stop; what lies beyond, up to ``end``, only
            makes sure that the motion can go on from there.
        start_rate: ds/dt at ``start``. Lowered if the limits cannot be met from it.

    Returns:
        The clock from ``start`` on, at multiples of PLAN_DT of real time, for as long
        as it has not passed ``commit``.
    """
    spline = CubicSpline(times, waypoints)
    count = max(2, round((end - start) / (0.5 * PLAN_DT)))
    grid = np.linspace(start, end, count + 1)
    if start_rate > 1 - 1e-6 and _feasible(spline, grid, limits):
        steps = int(np.floor((commit - start) / PLAN_DT + 1e-6))
        elapsed = PLAN_DT * np.arange(steps + 1, dtype=np.float64)
        return Clock(start + elapsed, np.ones(steps + 1))
    rates = _solve(spline, grid, limits, start_rate)
    return _sample(grid, rates, commit)


def _feasible(spline: CubicSpline, grid: Array, limits: PathLimits) -> bool:
    acceleration = spline(grid, 2)
    return bool(
        (np.abs(spline(grid, 1)) <= limits.speed).all()
        and (acceleration >= limits.acceleration[:, 0]).all()
        and (acceleration <= limits.acceleration[:, 1]).all()
    )


def _solve(
    spline: CubicSpline, grid: Array, limits: PathLimits, start_rate: float
) -> Array:
    """Returns ds/dt at the grid points by TOPP-RA."""
    speed = np.append(limits.speed, 1.0)
    clock = [[-1.0 / _CLOCK_STOP_TIME, 1.0 / _CLOCK_STOP_TIME]]
    acceleration = np.append(limits.acceleration, clock, axis=0)
    constraints = [
        JointVelocityConstraint(np.stack((-speed, speed), axis=1)),
        JointAccelerationConstraint(acceleration),
    ]
    path = _ClockedPath(spline, grid[0], grid[-1])
    solver = _FreeEndTOPPRA(constraints, path, gridpoints=grid, solver_wrapper="seidel")
    controllable = np.sqrt(solver.compute_controllable_sets(0.0, 1.0)[0])
    # A plan that starts outside the limits leaves no choice but a jump of the clock.
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
class Progress:
    """How far a plan has been re-timed; immutable, and a copy is the same object.

    Attributes:
        plan: what has been re-timed.
        path_time: plan time of its last sample, s.
        rate: ds/dt there.
        source: the plan that it was made of; None before there is anything.
    """

    plan: Plan
    path_time: float = 0.0
    rate: float = 1.0
    source: Plan | None = None

    def __deepcopy__(self, memo: dict[int, Any]) -> "Progress":
        return self

    def goes_on_in(self, raw: Plan) -> bool:
        """Returns whether ``raw`` holds the sample that was re-timed last.

        If it does not, it is another motion, not the same one written further.
        """
        source = self.source
        if source is None or raw is source:
            return source is not None
        here, there = (
            plan.q[int(np.searchsorted(plan.path_time, self.path_time)) :][:1]
            for plan in (source, raw)
        )
        return np.array_equal(here, there)


def smooth_chunk(
    robot: Robot, limits: PathLimits, progress: Progress, raw: Plan, chunk: float
) -> Progress | None:
    """Returns ``progress`` with one more chunk, or None if ``raw`` is too short.

    An open-ended plan must reach two chunks ahead; of a plan that ends, the last
    chunk may be shorter.
    """
    begun = progress.source is not None
    start = progress.path_time if begun else float(raw.path_time[0])
    last = float(raw.path_time[-1])
    if last - start < (2 * chunk if raw.open_ended else 2 * PLAN_DT):
        return None
    end = min(start + 2 * chunk, last)
    commit = min(start + chunk, last)
    # A margin on both sides makes the spline the same from one window to the next.
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
        commit=commit,
        start_rate=progress.rate,
    )
    if not begun:
        plan = _follow(robot, raw, window, clock, progress.plan.start_time)
    else:
        # The first sample is the last of what is committed already.
        clock = Clock(clock.path_time[1:], clock.rate[1:])
        if not len(clock.path_time):
            return None
        added = _follow(robot, raw, window, clock, progress.plan.end_time + PLAN_DT)
        plan = join_plans(progress.plan, added)
    return Progress(plan, float(clock.path_time[-1]), float(clock.rate[-1]), raw)


def _follow(robot: Robot, raw: Plan, window: slice, clock: Clock, start: float) -> Plan:
    """Returns ``raw`` as played by ``clock``, from context time ``start``."""
    s = clock.path_time
    times = raw.path_time[window]
    waypoints = raw.q[window].copy()
    waypoints[ORIENTATION] = quat_continuous(waypoints[ORIENTATION])
    q = CubicSpline(times, waypoints)(s)
    q[ORIENTATION] /= np.linalg.norm(q[ORIENTATION], axis=1, keepdims=True)
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
    """Returns the whole of ``raw``, re-timed chunk by chunk as the system does it."""
    progress = Progress(standing_plan(robot, raw.start_time))
    while (extended := smooth_chunk(robot, limits, progress, raw, chunk)) is not None:
        progress = extended
    return progress.plan
