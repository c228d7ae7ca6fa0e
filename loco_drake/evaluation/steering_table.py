"""How well a policy follows commands, label by label.

A label's figures are those of :mod:`loco_drake.evaluation.steering`:

* The *range* of a label is a box: an interval of forward and of sideways velocity and
  of yaw rate. It is searched for along each axis, outward from the gait's own pace and
  from 0, until the robot falls or the error of a point exceeds its goal; then all of it
  shrinks until the whole grid keeps the goals, without a fall, and the robot drives for
  60 s within .5 m of its plan.
* The *grid* is five values of each axis within the range, one axis at a time with the
  others at the middle, and the eight corners; 6 s each, of which the last 4 s count.
* *Steps* go from the middle of the range to both ends of the forward velocity and of
  the yaw rate, and back.
* *Changes* of gait lead to three gaits with other footfalls and back, every 5 s, at the
  middle of the range or what each gait's published range holds of it; see
  :mod:`loco_drake.evaluation.gait_change_time`.
* *Drives* are 60 s of commands drawn within the range, another every 2 s.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from loco_drake.common.arrays import Array
from loco_drake.control.command import CommandRange
from loco_drake.control.ground_path import ground_pose, path_velocity
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.evaluation.gait_change_time import gait_change_figures
from loco_drake.evaluation.motion_scores import median
from loco_drake.evaluation.steering import (
    distance_from_plan,
    reference_latency,
    rmse,
    robot_latency,
    stride_velocity,
)
from loco_drake.evaluation.steering_courses import (
    DISTANCE_GOAL,
    Course,
    Point,
    gait_changes,
    grid,
    keeps_goals,
    steps,
)
from loco_drake.evaluation.tracking import (
    Recorder,
    Rollout,
    effort_metrics,
    normalized_return,
    slip_speeds,
    stretch,
)
from loco_drake.models.plant import plant_damping
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion import FPS
from loco_drake.motion.quality import (
    joint_limit_violations,
    penetration_max,
    stance_slip_speeds,
)
from loco_drake.systems.scenario import Scenario
from loco_drake.systems.steering import command_ranges

POINT, SETTLING = 6.0, 2.0  # s of a point, and of those that do not count
_DRIVE, _CHANGE = 60.0, 2.0  # s
_GAIT_CHANGE = 5.0  # s
# Points of the search, m/s and rad/s; sideways and turning are tried to both sides.
_FORWARD_STEP = 0.25
_SIDES = ((1, (0.1, 0.2, 0.3, 0.4)), (2, (0.25, 0.5, 0.75, 1.0, 1.25)))
# Shares of forward velocity, and of sideways velocity and yaw rate, that are tried.
_SHRINK = (
    (1.0, 1.0),
    (1.0, 0.85),
    (1.0, 0.75),
    (0.9, 0.6),
    (0.8, 0.5),
    (0.7, 0.4),
    (0.6, 0.3),
    (0.4, 0.2),
)


class Driver:
    """Measures one label after the other in one diagram."""

    def __init__(self, scenario: Scenario) -> None:
        self.robot = get_robot(scenario.robot)
        self._damping = plant_damping(self.robot, scenario.plant)
        self._recorder = Recorder(scenario)
        self._command = self._recorder.diagram.GetInputPort("command")
        self._plan = self._recorder.diagram.GetOutputPort("plan")
        self._gait = self._recorder.diagram.GetInputPort("gait")
        self._published = command_ranges(self.robot)

    def __call__(self, course: Course) -> dict[str, Any]:
        """Returns the figures of a course."""
        seed = course.seeds[0]
        within = course.range or self._search(course.label, seed)
        points = [self._point(course.label, c, seed) for c in grid(within)]
        velocity, yaw_rate = rmse([p.errors for p in points])
        return {
            "range": within.figures(),
            "velocity_rmse_mps": velocity,
            "yaw_rate_rmse_radps": yaw_rate,
            "grid_return": float(np.mean([p.normalized_return for p in points])),
            "grid_falls": float(np.mean([p.fell for p in points])),
            "points": [
                {
                    "command": p.command.tolist(),
                    "velocity": p.velocity,
                    "normalized_return": p.normalized_return,
                    "cost_of_transport": p.cost_of_transport,
                    "fell": p.fell,
                }
                for p in points
            ],
            **self._steps(course.label, within, seed),
            **self._changes(course.label, within, seed),
            **self._drives(course.label, within, course.seeds),
        }

    def _search(self, label: str, seed: int) -> CommandRange:
        pace = round(float(self._pace(label, seed)[0]), 2)
        low, high = np.array([pace, 0.0, 0.0]), np.array([pace, 0.0, 0.0])
        forward = np.arange(-4, 13) * _FORWARD_STEP
        for values, end in (
            (forward[forward < pace][::-1], low),
            (forward[forward > pace], high),
        ):
            for value in values:
                if not self._is_good(label, [value, 0.0, 0.0], seed):
                    break
                end[0] = value
        middle = (low + high) / 2
        for axis, steps_of_axis in _SIDES:
            for value in steps_of_axis:
                there = [middle.copy(), middle.copy()]
                there[0][axis], there[1][axis] = value, -value
                if not all(self._is_good(label, c, seed) for c in there):
                    break
                low[axis], high[axis] = -value, value
        widest = CommandRange(tuple(low.tolist()), tuple(high.tolist()))
        for along, across in _SHRINK:
            within = widest.scaled((along, across, across))
            if self._keeps_goals(label, within, seed) and self._stays(
                label, within, seed
            ):
                break
        return within

    def _is_good(self, label: str, command: ArrayLike, seed: int) -> bool:
        return self._point(label, np.array(command, dtype=np.float64), seed).is_good

    def _keeps_goals(self, label: str, within: CommandRange, seed: int) -> bool:
        """Returns whether the whole grid keeps the goals without a fall."""
        errors = []
        # From the corners, where falls come first.
        for command in reversed(grid(within)):
            point = self._point(label, command, seed)
            if point.fell:
                return False
            errors.append(point.errors)
        return keeps_goals(errors)

    def _stays(self, label: str, within: CommandRange, seed: int) -> bool:
        """Returns whether a drive stays on its feet and near its plan."""
        drive = self._drives(label, within, [seed])
        near: bool = drive["distance_from_plan_max_m"] <= DISTANCE_GOAL
        return near and drive["fall_rate"] == 0

    def plan_of(self, name: str) -> Plan:
        """Returns the present plan of a subsystem: reference, steering or smoother."""
        system = self._recorder.diagram.GetSubsystemByName(name)
        context = system.GetMyContextFromRoot(self._recorder.context)
        plan: Plan = system.GetOutputPort("plan").Eval(context)
        return plan

    def _pace(self, label: str, seed: int) -> Array:
        """Returns the mean velocity of the gait's plan without a command, (3,)."""
        self._recorder.start(gait=label, seed=seed)
        plan = self.plan_of("reference")
        mean: Array = path_velocity(ground_pose(plan.q)).mean(axis=0)
        return mean

    def run(
        self,
        label: str,
        seed: int,
        duration: float,
        command: Callable[[int], Array],
        plans: list[Plan] | None = None,
        gait: Callable[[int], int] | None = None,
    ) -> Rollout:
        """Simulates a command, and a gait, that are functions of the sample."""
        context, own = self._recorder.context, parse_label(label).index
        # That of the last run would remain.
        self._gait.FixValue(context, float(own))
        self._recorder.start(gait=label, seed=seed)

        def after_step(time: float) -> None:
            sample = round(time / PLAN_DT)
            self._command.FixValue(context, command(sample))
            if gait is not None:
                self._gait.FixValue(context, float(gait(sample)))
            if plans is not None:
                plans.append(self._plan.Eval(context))

        after_step(0.0)
        rollout, _ = self._recorder.run(duration, after_step)
        return rollout

    def _point(self, label: str, command: Array, seed: int) -> Point:
        rollout = self.run(label, seed, POINT, lambda _: command)
        counted = round(SETTLING / PLAN_DT)
        velocity = stride_velocity(self.robot, rollout.state)[counted:]
        effort = effort_metrics(rollout, self.robot, self._damping)
        return Point(
            command=command,
            velocities=velocity,
            normalized_return=normalized_return(rollout),
            cost_of_transport=effort["cost_of_transport"],
            fell=rollout.fell,
        )

    def _steps(self, label: str, within: CommandRange, seed: int) -> dict[str, Any]:
        changed = round(POINT / 2 / PLAN_DT)
        reference: list[float | None] = []
        robot: list[float | None] = []
        for before, after in steps(within):
            plans: list[Plan] = []
            rollout = self.run(
                label, seed, POINT, partial(_step, before, after, changed), plans
            )
            reference.append(reference_latency(plans, changed))
            velocity = stride_velocity(self.robot, rollout.state)
            robot.append(
                None
                if rollout.fell
                else robot_latency(velocity, before, after, changed)
            )
        known = [latency for latency in robot if latency is not None]
        return {
            "latency_reference_s": max(filter(None, reference), default=None),
            "latency_robot_s": float(np.median(known)) if known else None,
            "steps": len(robot),
            "steps_covered": len(known),
        }

    def _changes(self, label: str, within: CommandRange, seed: int) -> dict[str, Any]:
        """Changes from a gait to others and back, in one drive."""
        gaits, commands = zip(
            *gait_changes(label, within, self._published), strict=True
        )
        period = round(_GAIT_CHANGE / PLAN_DT)
        plans: list[Plan] = []
        rollout = self.run(
            label,
            seed,
            len(gaits) * _GAIT_CHANGE,
            partial(_from_table, commands, period=period),
            plans,
            partial(_from_table, gaits, period=period),
        )
        played = np.array([p.labels[p.index(k * PLAN_DT)] for k, p in enumerate(plans)])
        return gait_change_figures(self.robot, rollout.state, played, commands, period)

    def _drives(
        self, label: str, within: CommandRange, seeds: Sequence[int]
    ) -> dict[str, Any]:
        drives = []
        for seed in seeds:
            random = np.random.default_rng(seed)
            table = random.uniform(
                within.low, within.high, (round(_DRIVE / _CHANGE) + 1, 3)
            )
            plans: list[Plan] = []
            command = partial(_from_table, table, period=round(_CHANGE / PLAN_DT))
            rollout = self.run(label, seed, _DRIVE, command, plans)
            drives.append((rollout, plans))
        p_WF = [
            np.array([p.p_WF[p.index(k * PLAN_DT)] for k, p in enumerate(plans)])
            for _, plans in drives
        ]
        radius = self.robot.foot_radius
        plan_slip = np.concatenate([stance_slip_speeds(p, radius, FPS) for p in p_WF])
        slip = np.concatenate([slip_speeds(r, self.robot) for r, _ in drives])
        rollouts = [rollout for rollout, _ in drives]
        return {
            "fall_rate": float(np.mean([r.fell for r in rollouts])),
            "normalized_return": float(
                np.mean([normalized_return(r) for r in rollouts])
            ),
            "distance_from_plan_max_m": max(
                distance_from_plan(r.state, r.plan_state) for r in rollouts
            ),
            "stance_slip_median_mps": median(slip),
            "plan_slip_median_mps": median(plan_slip),
            "plan_penetration_max_m": max(penetration_max(p, radius) for p in p_WF),
            "plan_joint_limit_violations": sum(
                joint_limit_violations(r.plan_state[:, 7:19], self.robot)
                for r in rollouts
            ),
            "stretch": float(np.mean([stretch(r) for r in rollouts])),
            "drives": len(drives),
        }


def _step(before: Array, after: Array, changed: int, sample: int) -> Array:
    return before if sample < changed else after


def _from_table(table: Sequence[Any] | Array, sample: int, *, period: int) -> Any:
    return table[min(sample // period, len(table) - 1)]


def run_courses(
    scenario: Scenario, courses: Sequence[Course], executor: Executor = LOCAL
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields label and figures of each course, in order."""
    results = executor.map(partial(Driver, scenario), courses)
    return zip((course.label for course in courses), results, strict=True)
