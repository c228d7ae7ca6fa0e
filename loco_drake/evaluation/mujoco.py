"""Recorded simulations in MuJoCo of the plan, the policy and the scores of Drake's."""

import time
from typing import Any

import numpy as np

from loco_drake.common.errors import InputError
from loco_drake.control.action import joint_targets, set_points
from loco_drake.control.actor_file import act, load_actor
from loco_drake.control.observation import observe, preview
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.control.reward import reward_terms
from loco_drake.control.state import has_fallen, split
from loco_drake.evaluation.tracking import Rollout
from loco_drake.models.mujoco_plant import MujocoConfig, MujocoPlant
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import policy_path
from loco_drake.systems.plan_recorder import PlanRecorder
from loco_drake.systems.scenario import Scenario, TrainedPolicy

_TOLERANCE = 1e-6  # of a step


class MujocoRecorder:
    """Tracks the plans of a ``scenario`` in MuJoCo instead of its plant.

    As :class:`loco_drake.evaluation.tracking.Recorder`, but a fall is noticed at the
    end of a control period, not of a time step. Plans are recorded first: they depend
    on no robot. The scenario has a trained policy.

    Raises:
        InputError: if the time step does not divide the control period.
    """

    def __init__(self, scenario: Scenario, config: MujocoConfig) -> None:
        assert isinstance(scenario.policy, TrainedPolicy)
        self._robot = robot = get_robot(scenario.robot)
        weights = policy_path(robot, scenario.policy.weights)
        self._actor = load_actor(weights, robot)
        steps = PLAN_DT / config.time_step
        if abs(steps - round(steps)) > _TOLERANCE:
            raise InputError(
                f"The time step must divide {PLAN_DT:g} s, as 0.002 does, not "
                f"{config.time_step:g}."
            )
        self._plant = MujocoPlant(robot, config)
        self._plans = PlanRecorder(scenario)
        self._reference: dict[str, Any] = {}

    def start(self, **reference: Any) -> None:
        """Starts an episode with a gait and a seed, or a plan; see PlanRecorder."""
        self._reference = reference

    def run(self, duration: float) -> tuple[Rollout, float]:
        """Simulates until ``duration``, s, or a fall; call :meth:`start` first.

        Returns:
            The record, and the wall time of plan and simulation, s.
        """
        begin = time.perf_counter()
        plan = self._plans.record(duration, **self._reference)
        rollout = self._track(plan, round(duration / PLAN_DT))
        return rollout, time.perf_counter() - begin

    def _track(self, plan: Plan, steps: int) -> Rollout:
        robot, plant = self._robot, self._plant
        state, action = plan.state[plan.index(0.0)], np.zeros(12)
        memory = np.zeros(self._actor.memory_size)
        plant.set_state(state)
        # Set-points of a period are recorded with the state at its end, as in Drake.
        states, desired = [state], [robot.stand_joints]
        fell = False
        for k in range(steps):
            now = k * PLAN_DT
            seen = observe(robot, preview(plan, now), state, action)
            action, memory = act(self._actor, seen, memory)
            due = set_points(robot, plan)[plan.index(now + PLAN_DT)]
            targets = joint_targets(due, action)[:12]
            state = plant.advance(targets, PLAN_DT)
            lies = has_fallen(robot, split(state)[0])
            fell = not np.isfinite(state).all() or bool(lies)
            if fell:
                break
            states.append(state)
            desired.append(targets)
        samples = [plan.index(k * PLAN_DT) for k in range(len(states))]
        made, wanted = np.array(states), plan.state[samples]
        terms = reward_terms(robot, wanted, plan.p_BoF_H[samples], made)
        return Rollout(
            state=made,
            plan_state=wanted,
            path_time=plan.path_time[samples],
            desired_joints=np.array(desired),
            reward=terms.sum(axis=1),
            steps=steps,
            fell=fell,
        )
