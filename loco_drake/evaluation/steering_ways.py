"""What bending a plan, telling the generator, and both give: a comparison.

The same commands are driven in each of :data:`.naturalness.WAYS`: the middle of the
label's range and four commands on each of its axes, 6 s each, of which the last 4 s
count. The *bend* is what bending still has to do at the end of a point: the distance of
the mean velocities of the generated and of the steered plan.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.ground_path import ground_pose, path_velocity
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.evaluation.motion_scores import median
from loco_drake.evaluation.naturalness import WAYS
from loco_drake.evaluation.steering import rmse, stride_velocity
from loco_drake.evaluation.steering_courses import Course, axis_points
from loco_drake.evaluation.steering_table import POINT, SETTLING, Driver
from loco_drake.evaluation.tracking import normalized_return, stretch
from loco_drake.motion.motion import FPS
from loco_drake.motion.quality import joint_limit_violations, stance_slip_speeds
from loco_drake.systems.scenario import Scenario, SteeringConfig


class _Ways:
    """Drives labels in one way after the other."""

    def __init__(self, scenario: Scenario) -> None:
        assert scenario.steering is not None
        self._drivers = {
            way: Driver(_steered(scenario, scenario.steering, bend, tell))
            for way, (bend, tell) in WAYS.items()
        }

    def __call__(self, course: Course) -> dict[str, Any]:
        assert course.range is not None
        commands = axis_points(course.range)
        return {
            "range": course.range.figures(),
            "points": len(commands) * len(course.seeds),
            **{
                way: _drive(driver, course.label, commands, course.seeds)
                for way, driver in self._drivers.items()
            },
        }


def _steered(
    scenario: Scenario, steering: SteeringConfig, bend: bool, tell: bool
) -> Scenario:
    return replace(scenario, steering=replace(steering, bend=bend, tell=tell))


def _drive(
    driver: Driver, label: str, commands: Sequence[Array], seeds: Sequence[int]
) -> dict[str, Any]:
    """Returns the figures of one way."""
    robot, counted = driver.robot, round(SETTLING / PLAN_DT)
    errors: list[Array] = []
    plan_errors: list[Array] = []
    bends, slips, rollouts = [], [], []
    for seed, command in product(seeds, commands):
        plans: list[Plan] = []
        rollout = driver.run(label, seed, POINT, partial(_constant, command), plans)
        rollouts.append(rollout)
        for found, state in (
            (errors, rollout.state),
            (plan_errors, rollout.plan_state),
        ):
            found.append(stride_velocity(robot, state)[counted:] - command)
        p_WF = [p.p_WF[p.index(k * PLAN_DT)] for k, p in enumerate(plans)]
        slips.append(stance_slip_speeds(np.array(p_WF), robot.foot_radius, FPS))
        bends.append(_mean(driver, "steering") - _mean(driver, "reference"))
    velocity, yaw_rate = rmse(errors)
    plan_velocity, plan_yaw_rate = rmse(plan_errors)
    bend = np.array(bends)
    return {
        "velocity_rmse_mps": velocity,
        "yaw_rate_rmse_radps": yaw_rate,
        "plan_velocity_rmse_mps": plan_velocity,
        "plan_yaw_rate_rmse_radps": plan_yaw_rate,
        "bend_mps": float(np.hypot(bend[:, 0], bend[:, 1]).mean()),
        "bend_radps": float(np.abs(bend[:, 2]).mean()),
        "normalized_return": float(np.mean([normalized_return(r) for r in rollouts])),
        "fall_rate": float(np.mean([r.fell for r in rollouts])),
        "plan_slip_median_mps": median(np.concatenate(slips)),
        "plan_joint_limit_violations": sum(
            joint_limit_violations(r.plan_state[:, 7:19], robot) for r in rollouts
        ),
        "stretch": float(np.mean([stretch(r) for r in rollouts])),
    }


def _constant(command: Array, _: int) -> Array:
    return command


def _mean(driver: Driver, name: str) -> Array:
    """Returns the mean velocity of the present plan of a subsystem, (3,)."""
    mean: Array = path_velocity(ground_pose(driver.plan_of(name).q)).mean(axis=0)
    return mean


def compare_ways(
    scenario: Scenario, courses: Sequence[Course], executor: Executor = LOCAL
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields label and figures of each course, which has a range, in order."""
    results = executor.map(partial(_Ways, scenario), courses)
    return zip((course.label for course in courses), results, strict=True)
