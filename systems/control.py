"""The systems between a plan and a plant; each applies a function of control/."""

from typing import Any

import torch
from pydrake.common.value import Value
from pydrake.systems.framework import Context, EventStatus, LeafSystem, State

from loco_drake.common.determinism import single_thread
from loco_drake.control.action import joint_targets, set_points
from loco_drake.control.actor import Actor
from loco_drake.control.observation import OBSERVATION_SIZE, observe, preview
from loco_drake.control.plan import PLAN_DT, Plan, standing_plan
from loco_drake.control.reward import REWARD_TERMS, reward_terms
from loco_drake.control.state import unit_base
from loco_drake.models.robots import Robot


class RobotState(LeafSystem):
    """Outputs the robot's state with the base's quaternion at length one.

    .. pydrake_system::

        name: RobotState
        input_ports:
        - plant_state: [q, v] of the robot's model instance, size 13 + 2 J; m, rad, s
        output_ports:
        - state: the same after :func:`unit_base`; what looks at the robot takes this
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self.robot = robot
        size = 13 + 2 * len(robot.joint_names)
        self._state = self.DeclareVectorInputPort("plant_state", size)
        self.DeclareVectorOutputPort(
            "state", size, self._calc, prerequisites_of_calc={self._state.ticket()}
        )

    def _calc(self, context: Context, output: Any) -> None:
        output.set_value(unit_base(self._state.Eval(context)))


class _PlanFollower(LeafSystem):
    """A system with an input port ``plan``."""

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._robot = robot
        self._joints = len(robot.joint_names)
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))
        self._plan_now = {self.time_ticket(), self._plan.ticket()}

    def _now(self, context: Context) -> tuple[Plan, int]:
        """Returns the plan, and which of its samples is the present one."""
        plan = self._plan.Eval(context)
        return plan, plan.index(context.get_time())


class PlanState(_PlanFollower):
    """Outputs the state that the plan wants now, and the plan time that has passed.

    .. pydrake_system::

        name: PlanState
        input_ports:
        - plan: a Plan
        output_ports:
        - state: [q, v] in the plant's order, size 13 + 2 J; m, rad, s
        - path_time: seconds of motion as it was written, size 1
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        for name, size, calc in (
            ("state", 13 + 2 * self._joints, self._calc_state),
            ("path_time", 1, self._calc_path_time),
        ):
            self.DeclareVectorOutputPort(
                name, size, calc, prerequisites_of_calc=self._plan_now
            )

    def _calc_state(self, context: Context, output: Any) -> None:
        plan, k = self._now(context)
        output.set_value(plan.state[k])

    def _calc_path_time(self, context: Context, output: Any) -> None:
        plan, k = self._now(context)
        output[0] = plan.path_time[k]


class Observation(_PlanFollower):
    """Computes :func:`observe` from its inputs.

    .. pydrake_system::

        name: Observation
        input_ports:
        - plan: a Plan
        - state: [q, v] of the robot, as it is measured, size 13 + 2 J; m, rad, s
        - action: the policy's, as it is being applied, size J
        output_ports:
        - observation: see OBSERVATION_LAYOUT, size OBSERVATION_SIZE
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * self._joints)
        self._action = self.DeclareVectorInputPort("action", self._joints)
        self.DeclareVectorOutputPort(
            "observation",
            OBSERVATION_SIZE,
            self._calc,
            prerequisites_of_calc={
                *self._plan_now,
                self._state.ticket(),
                self._action.ticket(),
            },
        )

    def _calc(self, context: Context, output: Any) -> None:
        ahead = preview(self._plan.Eval(context), context.get_time())
        state, action = self._state.Eval(context), self._action.Eval(context)
        output.set_value(observe(self._robot, ahead, state, action))


class TrackingPolicy(LeafSystem):
    """Outputs the network's mean action for the observation at its input.

    .. pydrake_system::

        name: TrackingPolicy
        input_ports:
        - observation: see OBSERVATION_LAYOUT, size OBSERVATION_SIZE
        output_ports:
        - action: in units of ACTION_SCALE, size 12

    It has no state and no clock: :class:`JointTargets` decides when to sample it.
    """

    def __init__(self, actor: Actor) -> None:
        super().__init__()
        self._actor = actor
        self._observation = self.DeclareVectorInputPort("observation", OBSERVATION_SIZE)
        self.DeclareVectorOutputPort(
            "action",
            12,
            self._calc,
            prerequisites_of_calc={self._observation.ticket()},
        )

    def _calc(self, context: Context, output: Any) -> None:
        observation = torch.from_numpy(self._observation.Eval(context)).float()
        # In a user's process, too: torch's second thread would wait for a busy core.
        with torch.inference_mode(), single_thread():
            output.set_value(self._actor(observation).double().numpy())


class JointTargets(_PlanFollower):
    """Holds, for one control period, the reference plus the policy's correction.

    .. pydrake_system::

        name: JointTargets
        input_ports:
        - plan: a Plan
        - action: the policy's, in units of ACTION_SCALE, size J
        output_ports:
        - desired_state: what the PD is sent, [q_d, 0], rad and rad/s, size 2 J
        - action: the one that is being held, size J

    Every PLAN_DT it samples its inputs and sets :func:`joint_targets` of the action and
    of the plan's :func:`set_points` at t + PLAN_DT. The sampling is an unrestricted
    update, which Drake performs before the plant's discrete update at the same time:
    the action reaches the joints without delay.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        still = 0 * robot.stand_joints
        self._action = self.DeclareVectorInputPort("action", self._joints)
        self._targets = self.DeclareDiscreteState(
            joint_targets(robot.stand_joints, still)
        )
        self._held = self.DeclareDiscreteState(still)
        # Ports of states need no Python while the plant steps.
        self.DeclareStateOutputPort("desired_state", self._targets)
        self.DeclareStateOutputPort("action", self._held)
        self.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=PLAN_DT, offset_sec=0.0, update=self._sample
        )

    def _sample(self, context: Context, state: State) -> EventStatus:
        plan = self._plan.Eval(context)
        action = self._action.Eval(context)
        due = set_points(self._robot, plan)[plan.index(context.get_time() + PLAN_DT)]
        targets = state.get_mutable_discrete_state(int(self._targets))
        targets.set_value(joint_targets(due, action))
        state.get_mutable_discrete_state(int(self._held)).set_value(action)
        return EventStatus.Succeeded()


class TrackingReward(_PlanFollower):
    """Computes :func:`reward_terms` from its inputs.

    .. pydrake_system::

        name: TrackingReward
        input_ports:
        - plan: a Plan
        - state: [q, v] of the robot, size 13 + 2 J; m, rad, s
        output_ports:
        - reward_terms: weighted, see REWARD_TERMS, size 5
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * self._joints)
        self.DeclareVectorOutputPort(
            "reward_terms",
            len(REWARD_TERMS),
            self._calc,
            prerequisites_of_calc={*self._plan_now, self._state.ticket()},
        )

    def _calc(self, context: Context, output: Any) -> None:
        plan, k = self._now(context)
        state = self._state.Eval(context)
        output.set_value(
            reward_terms(self._robot, plan.state[k], plan.p_BoF_H[k], state)
        )
