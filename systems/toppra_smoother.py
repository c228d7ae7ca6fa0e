"""The system that re-times a plan to satisfy the limits of the actuators."""

from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import Context, State

from loco_drake.control.plan import UPDATE_PERIOD, standing_plan
from loco_drake.control.retiming import (
    PathLimits,
    Progress,
    fall_limit,
    no_progress,
    path_limits,
    smooth_chunk,
)
from loco_drake.models.robots import Robot

from .plan_producer import PlanProducer
from .scenario import SmootherConfig


class ToppraSmoother(PlanProducer):
    """Re-times the incoming plan so that joints and base satisfy :func:`path_limits`.

    .. pydrake_system::

        name: ToppraSmoother
        input_ports:
        - plan: abstract, Plan; before smoothing
        output_ports:
        - plan: abstract, Plan; smoothed
        - path_time: vector (1,), how much of the input has been used; s
        - fixed_time: vector (1,), plan time up to which the output is final; s
        - clock_rate: vector (1,), seconds of the input per second; mean of the output

    The output is on the Context's clock and is never faster than the input. It is
    extended by one chunk whenever it reaches less than ``lookahead`` ahead and the
    input is long enough; samples in the past are dropped. Where the input changes after
    ``fixed_time``, the output is made again from there. If the input is replaced by
    another plan, such as a player's new one, the system starts it at once.

    Args:
        config: chunk and look-ahead.
        limits: limits that replace the robot's own.

    Raises:
        InputError: if a number in ``config`` is out of its bounds.
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
        self._config.check()
        self._limits = limits or path_limits(
            robot, self._config.fall or fall_limit(grounded=False)
        )
        rest = standing_plan(robot)
        self._plan_in = self.DeclareAbstractInputPort("plan", Value(rest))
        self._DeclarePlan(no_progress(robot, 0.0))
        self.DeclareVectorOutputPort(
            "path_time",
            1,
            self._calc_path_time,
            prerequisites_of_calc={self.xa_ticket()},
        )
        self.DeclareVectorOutputPort(
            "fixed_time",
            1,
            self._calc_fixed_time,
            prerequisites_of_calc={self.xa_ticket(), self.time_ticket()},
        )
        self.DeclareVectorOutputPort(
            "clock_rate",
            1,
            self._calc_clock_rate,
            prerequisites_of_calc={self.xa_ticket()},
        )
        self.DeclareInitializationUnrestrictedUpdateEvent(self._initialize)

    def _calc_path_time(self, context: Context, output: Any) -> None:
        output[0] = self._get(context).path_time

    def _calc_fixed_time(self, context: Context, output: Any) -> None:
        # What another system changes at this update is seen here at the next one, and
        # must then not be played before the one after it.
        plan = self._get(context).plan
        output[0] = plan.path_time[plan.index(context.get_time() + 2 * UPDATE_PERIOD)]

    def _calc_clock_rate(self, context: Context, output: Any) -> None:
        output[0] = self._get(context).rate.mean()

    def _initialize(self, context: Context, state: State) -> None:
        # The clone of a Context that has run continues as the original would.
        if self._kept(context, self._get(context)).source is None:
            self._update(context, state)

    def _kept(self, context: Context, progress: Progress) -> Progress:
        """Returns what remains of ``progress`` with the present input."""
        now = context.get_time()
        kept = progress.before_change(self._plan_in.Eval(context))
        if kept.source is None or kept.plan.end_time < now:
            return no_progress(self._robot, now)
        return kept

    def _next(self, context: Context, progress: Progress) -> Progress:
        """Returns ``progress`` with all chunks added that are due and available."""
        now, raw = context.get_time(), self._plan_in.Eval(context)
        lookahead = self._config.lookahead
        progress = self._kept(context, progress)
        due = now + lookahead + UPDATE_PERIOD
        while progress.source is None or progress.plan.end_time < due:
            extended = smooth_chunk(
                self._robot, self._limits, progress, raw, self._config.chunk
            )
            if extended is None:
                break
            progress = extended
        if progress.plan.start_time < now - 2 * lookahead:
            progress = progress.slice(progress.plan.index(now - lookahead))
        return progress
