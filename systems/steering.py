"""The system that makes a plan go where it is told."""

import json
from dataclasses import dataclass, replace
from math import nan
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import Context

from loco_drake.common.immutable import Immutable
from loco_drake.control.command import CommandRange, check_finite
from loco_drake.control.plan import Plan, first_change, standing_plan
from loco_drake.control.steering import Steered, begin, steer
from loco_drake.models.robots import Robot
from loco_drake.models.shipped import results_path
from loco_drake.motion.gaits import parse_label

from .plan_producer import PlanProducer
from .scenario import SteeringConfig

# A plan that was only extended is steered again from this long before its old end, s:
# its pace and its last stances were not known yet.
_UNSURE = 1.5
# A clock that is slower than this counts as this.
_SLOWEST = 0.5
# A plan is steered again if its clock changes by this.
_CHANGED = 0.05


@dataclass(frozen=True, eq=False)
class _Course(Immutable):
    """The steered plan and the command that it follows."""

    plan: Plan  # as in ``steered``; standing before the first command
    steered: Steered | None = None  # None before the first command
    command: tuple[float, ...] = ()
    clock_rate: float = 1.0  # at the last update that steered


def command_ranges(robot: Robot) -> dict[int, CommandRange]:
    """Returns the ranges of commands that are published for ``robot``, by gait.

    They are those of `evaluate steering`; the keys are rows of gaits.ONE_HOT.
    """
    path = results_path(f"steering-{robot.name}")
    if not path.is_file():
        return {}
    labels = json.loads(path.read_text())["labels"]
    return {
        parse_label(label).index: CommandRange.of_figures(figures["range"])
        for label, figures in labels.items()
    }


class Steering(PlanProducer):
    """Bends the ground path of a plan until the base moves as commanded.

    .. pydrake_system::

        name: Steering
        input_ports:
        - plan: abstract, Plan
        - command: vector (3,), forward, sideways, yaw rate in H; m/s, rad/s; optional
        - fixed_time: vector (1,), plan time up to which nothing changes; s; optional
        - clock_rate: vector (1,), seconds of the plan per second; optional
        output_ports:
        - plan: abstract, Plan; on the clock of the input
        - asked: vector (3,), the command as it is given, nan without one; m/s, rad/s
        - followed: vector (3,), the command as far as it is followed; m/s, rad/s
        - told: vector (3,), the command as it was sampled, NaN without one; m/s, rad/s

    H is the base's heading frame. A critically damped filter turns the command into the
    velocity of the plan, see :mod:`loco_drake.control.steering`. Commands are kept in
    the range of each gait; of one that legs or joints cannot follow, the largest
    possible share is followed. ``followed`` tells what remains. Without a command the
    output is the input itself, and ``followed`` is 0; so it is if ``config`` does not
    want it bent.

    The command is sampled every ``UPDATE_PERIOD`` into the state, of which the outputs
    are functions. ``fixed_time`` and ``clock_rate`` come from the smoother; without
    them the Context's time and 1 are used. A plan that is slowed moves faster by its
    own clock, so that the robot moves as commanded.

    Args:
        robot: the robot.
        config: response of the filter, and what it is for.

    Raises:
        InputError: if a number in ``config`` is out of its bounds or, during a
            simulation, a command is not finite.
    """

    def __init__(self, robot: Robot, config: SteeringConfig | None = None) -> None:
        super().__init__()
        self._robot = robot
        self._config = config or SteeringConfig()
        self._config.check()
        self._ranges = command_ranges(robot) if self._config.measured_ranges else {}
        rest = standing_plan(robot)
        self._plan = self.DeclareAbstractInputPort("plan", Value(rest))
        self._command = self.DeclareVectorInputPort("command", 3)
        self._fixed_time = self.DeclareVectorInputPort("fixed_time", 1)
        self._clock_rate = self.DeclareVectorInputPort("clock_rate", 1)
        self._DeclarePlan(_Course(rest), self._plan.ticket())
        self.DeclareVectorOutputPort(
            "asked", 3, self._calc_asked, prerequisites_of_calc={self._command.ticket()}
        )
        self.DeclareVectorOutputPort(
            "followed", 3, self._calc_followed, prerequisites_of_calc={self.xa_ticket()}
        )
        self.DeclareVectorOutputPort(
            "told", 3, self._calc_told, prerequisites_of_calc={self.xa_ticket()}
        )

    def _calc_plan(self, context: Context, output: AbstractValue) -> None:
        course = self._get(context)
        output.set_value(
            self._plan.Eval(context) if course.steered is None else course.plan
        )

    def _calc_asked(self, context: Context, output: Any) -> None:
        given = self._command.HasValue(context)
        output.set_value(self._command.Eval(context) if given else [np.nan] * 3)

    def _calc_followed(self, context: Context, output: Any) -> None:
        course = self._get(context)
        if course.steered is None:
            output.set_value([0.0] * 3)
        else:
            output.set_value(course.clock_rate * course.steered.command)

    def _calc_told(self, context: Context, output: Any) -> None:
        output.set_value(self._get(context).command or [nan] * 3)

    def _next(self, context: Context, course: _Course) -> _Course:
        if not self._command.HasValue(context):
            return course
        command = self._command.Eval(context)
        if not self._config.bend:
            check_finite(command)
            if tuple(command) == course.command:
                return course
            return replace(course, command=tuple(command))
        raw = self._plan.Eval(context)
        fixed = context.get_time()
        if self._fixed_time.HasValue(context):
            fixed = float(self._fixed_time.Eval(context)[0])
        clock_rate = 1.0
        if self._clock_rate.HasValue(context):
            clock_rate = max(float(self._clock_rate.Eval(context)[0]), _SLOWEST)
        steered = course.steered
        if steered is not None:
            changed = first_change(steered.raw, raw)
            if changed <= fixed:
                # Another motion, which the smoother plays from its beginning.
                steered, fixed = None, float(raw.path_time[0])
            elif (
                tuple(command) == course.command
                and abs(clock_rate - course.clock_rate) < _CHANGED
            ):
                if raw is steered.raw:
                    return course
                fixed = max(fixed, changed - _UNSURE)
        steered = steer(
            self._robot,
            steered or begin(raw),
            raw,
            command,
            fixed,
            self._config.response,
            self._ranges,
            clock_rate,
        )
        return _Course(steered.plan, steered, tuple(command), clock_rate)
