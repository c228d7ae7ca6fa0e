"""The system that re-times a plan to what the actuators can do."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import Context, EventStatus, LeafSystem, State
from scipy.interpolate import CubicSpline

from loco_drake.common.rotations import quat_continuous
from loco_drake.control.plan import (
    PLAN_DT,
    UPDATE_PERIOD,
    Plan,
    join_plans,
    make_plan,
    standing_plan,
)
from loco_drake.control.retiming import Clock, PathLimits, path_limits, retime
from loco_drake.models.robots import Robot

Array = NDArray[np.float64]


@dataclass(kw_only=True)
class SmootherConfig:
    """How far and how often plans are re-timed.

    Attributes:
        chunk: seconds of plan that are committed at a time; as much again is solved
            for, so that the motion can always go on from what is committed.
        lookahead: seconds of smoothed plan kept ahead of the clock.
    """

    chunk: float = 0.96
    lookahead: float = 1.0


@dataclass(frozen=True, eq=False)
class _Progress:
    """Immutable state: what has been smoothed, and where to go on."""

    plan: Plan
    path_time: float = 0.0
    rate: float = 1.0
    started: bool = False

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Progress":
        return self


class ToppraSmoother(LeafSystem):
    """Re-times the incoming plan so that joints and base keep :func:`path_limits`.

    .. pydrake_system::

        name: ToppraSmoother
        input_ports:
        - plan
        output_ports:
        - plan
        - path_time

    The output plan runs on the context's clock and is never faster than the input;
    it grows by chunks as the clock comes near its end and the input reaches far
    enough, and what has been played long ago is dropped. ``path_time`` (s) is how
    much of the input has been used up, which tells the producer when to write more.

    Args:
        robot: whose limits hold.
        config: chunk and look-ahead.
        limits: instead of the robot's own.
    """

    def __init__(
        self,
        robot: Robot,
        config: SmootherConfig | None = None,
        limits: PathLimits | None = None,
    ) -> None:
        super().__init__()
        self._robot = robot
        self._config = config or SmootherConfig()
        self._limits = limits or path_limits(robot)
        rest = standing_plan(robot)
        self._plan_in = self.DeclareAbstractInputPort("plan", Value(rest))
        self._progress = self.DeclareAbstractState(Value(_Progress(rest)))
        state = {self.abstract_state_ticket(self._progress)}
        self.DeclareAbstractOutputPort(
            "plan", lambda: Value(rest), self._calc_plan, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "path_time", 1, self._calc_path_time, prerequisites_of_calc=state
        )
        self.DeclareInitializationUnrestrictedUpdateEvent(self._initialize)
        self.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=UPDATE_PERIOD, offset_sec=0.0, update=self._update
        )

    def _calc_plan(self, context: Context, output: AbstractValue) -> None:
        output.set_value(self._get(context).plan)

    def _calc_path_time(self, context: Context, output: Any) -> None:
        output[0] = self._get(context).path_time

    def _get(self, context: Context) -> _Progress:
        progress = context.get_abstract_state(int(self._progress)).get_value()
        assert isinstance(progress, _Progress)
        return progress

    def _initialize(self, context: Context, state: State) -> EventStatus:
        # A clone of a context that has run goes on; SetDefaultContext starts anew.
        if self._get(context).started:
            return EventStatus.DidNothing()
        raw = self._plan_in.Eval(context)
        now = context.get_time()
        rest = _Progress(standing_plan(self._robot, now))
        return self._store(state, self._extended(rest, raw, now))

    def _update(self, context: Context, state: State) -> EventStatus:
        raw = self._plan_in.Eval(context)
        old = self._get(context)
        new = self._extended(old, raw, context.get_time())
        if new is old:
            return EventStatus.DidNothing()
        return self._store(state, new)

    def _store(self, state: State, progress: _Progress) -> EventStatus:
        state.get_mutable_abstract_state(int(self._progress)).set_value(progress)
        return EventStatus.Succeeded()

    def _extended(self, progress: _Progress, raw: Plan, now: float) -> _Progress:
        """Returns ``progress`` with as many chunks added as are due and possible."""
        due = now + self._config.lookahead + UPDATE_PERIOD
        if not progress.started:
            progress = _Progress(standing_plan(self._robot, now))
        while not progress.started or progress.plan.end_time < due:
            extended = smooth_chunk(
                self._robot, self._limits, progress, raw, self._config.chunk
            )
            if extended is None:
                break
            progress = extended
        if progress.plan.start_time < now - 2 * self._config.lookahead:
            keep = progress.plan.index(now - self._config.lookahead)
            progress = _Progress(
                progress.plan.tail(keep), progress.path_time, progress.rate, True
            )
        return progress


def smooth_chunk(
    robot: Robot, limits: PathLimits, progress: _Progress, raw: Plan, chunk: float
) -> _Progress | None:
    """Returns ``progress`` with one more chunk, or None if ``raw`` is too short.

    An open-ended plan must reach two chunks ahead; of a plan that ends, the last
    chunk may be shorter.
    """
    start = progress.path_time if progress.started else float(raw.path_time[0])
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
        np.column_stack((raw.q[window, 7:], raw.q[window, 6])),
        limits,
        start=start,
        end=end,
        commit=commit,
        start_rate=progress.rate,
    )
    if not progress.started:
        plan = _follow(robot, raw, window, clock, progress.plan.start_time)
    else:
        # The first sample is the last of what is committed already.
        clock = Clock(clock.path_time[1:], clock.rate[1:])
        if not len(clock.path_time):
            return None
        added = _follow(robot, raw, window, clock, progress.plan.end_time + PLAN_DT)
        plan = join_plans(progress.plan, added)
    return _Progress(plan, float(clock.path_time[-1]), float(clock.rate[-1]), True)


def _follow(robot: Robot, raw: Plan, window: slice, clock: Clock, start: float) -> Plan:
    """Returns ``raw`` as played by ``clock``, from context time ``start``."""
    s = clock.path_time
    times = raw.path_time[window]
    waypoints = raw.q[window].copy()
    waypoints[:, :4] = quat_continuous(waypoints[:, :4])
    q = CubicSpline(times, waypoints)(s)
    q[:, :4] /= np.linalg.norm(q[:, :4], axis=1, keepdims=True)
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
    progress = _Progress(standing_plan(robot, raw.start_time))
    while (extended := smooth_chunk(robot, limits, progress, raw, chunk)) is not None:
        progress = extended
    return progress.plan
