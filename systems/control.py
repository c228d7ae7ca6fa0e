"""Systems between a plan and a plant. Most apply a function of control/."""

from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import (
    Context,
    Diagram,
    LeafSystem,
    State,
    ValueProducer,
)

from loco_drake.control.action import joint_targets, set_points
from loco_drake.control.actor import Actor
from loco_drake.control.actor_file import act
from loco_drake.control.observation import layout_of, observe, preview
from loco_drake.control.plan import PLAN_DT, Plan, standing_plan
from loco_drake.control.reward import REWARD_TERMS, reward_terms
from loco_drake.control.state import unit_base
from loco_drake.control.terrain import Terrain
from loco_drake.models.simulated import SimulatedRobot


class PlanPlayer(LeafSystem):
    """Outputs the plan that is set in its Context.

    .. pydrake_system::

        name: PlanPlayer
        output_ports:
        - plan: abstract, Plan

    The plan is an abstract parameter: constant during a simulation, and set for each
    episode with :meth:`SetPlan`. In a default Context it is ``plan``; by default the
    robot stands.
    """

    def __init__(self, robot: SimulatedRobot, plan: Plan | None = None) -> None:
        super().__init__()
        first = Value(plan or standing_plan(robot))
        self._plan = self.DeclareAbstractParameter(first)
        self.DeclareAbstractOutputPort("plan", first.Clone, self._calc)

    def SetPlan(self, context: Context, plan: Plan) -> None:
        """Sets the plan to play in ``context``, which is this system's own."""
        context.get_mutable_abstract_parameter(self._plan).set_value(plan)

    def _calc(self, context: Context, output: AbstractValue) -> None:
        output.set_value(context.get_abstract_parameter(self._plan).get_value())


class RobotState(LeafSystem):
    """Outputs the robot's state with a unit quaternion, see :func:`unit_base`.

    .. pydrake_system::

        name: RobotState
        input_ports:
        - plant_state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s
        output_ports:
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s

    All observers of the robot read this port rather than the plant's. On a terrain,
    which is a parameter, the state is that over the ground, see :class:`Terrain`.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__()
        self.robot = robot
        size = 13 + 2 * len(robot.joint_names)
        # A tuple of one or none, since a Value cannot begin with None in all Drakes.
        self._terrain = self.DeclareAbstractParameter(AbstractValue.Make(()))
        self._state = self.DeclareVectorInputPort("plant_state", size)
        self.DeclareVectorOutputPort("state", size, self._calc)

    def SetTerrain(self, context: Context, terrain: Terrain | None) -> None:
        """Sets the terrain, None if level, in ``context``, this system's own."""
        held = () if terrain is None else (terrain,)
        context.get_mutable_abstract_parameter(self._terrain).set_value(held)

    def GetTerrain(self, context: Context) -> Terrain | None:
        """Returns the terrain in ``context``, this system's own."""
        held: tuple[Terrain, ...] = context.get_abstract_parameter(
            self._terrain
        ).get_value()
        return held[0] if held else None

    def _calc(self, context: Context, output: Any) -> None:
        state = unit_base(self._state.Eval(context))
        terrain = self.GetTerrain(context)
        output.set_value(state if terrain is None else terrain.over_ground(state))


def FindRobot(
    diagram: Diagram,
) -> tuple[SimulatedRobot, MultibodyPlant, ModelInstanceIndex]:
    """Returns robot, plant and the robot's instance in it, of a locomotion diagram."""
    robot = diagram.GetSubsystemByName("robot_state").robot
    plant = diagram.GetSubsystemByName("plant")
    return robot, plant, plant.GetModelInstanceByName(robot.name)


class PlanFollower(LeafSystem):
    """Base of systems with an input port ``plan``, of a robot."""

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__()
        self._robot = robot
        self._joints = len(robot.joint_names)
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))

    def _now(self, context: Context) -> tuple[Plan, int]:
        """Returns the plan and the index of its current sample."""
        plan = self._plan.Eval(context)
        return plan, plan.index(context.get_time())


class PlanState(PlanFollower):
    """Outputs the plan's current state and path time.

    .. pydrake_system::

        name: PlanState
        input_ports:
        - plan: abstract, Plan
        output_ports:
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s
        - path_time: vector (1,), time before smoothing; s
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        size = 13 + 2 * self._joints
        self.DeclareVectorOutputPort("state", size, self._calc_state)
        self.DeclareVectorOutputPort("path_time", 1, self._calc_path_time)

    def _calc_state(self, context: Context, output: Any) -> None:
        plan, k = self._now(context)
        output.set_value(plan.state[k])

    def _calc_path_time(self, context: Context, output: Any) -> None:
        plan, k = self._now(context)
        output[0] = plan.path_time[k]


class Observation(PlanFollower):
    """Outputs the observation of the policy, see :func:`observe`.

    .. pydrake_system::

        name: Observation
        input_ports:
        - plan: abstract, Plan
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s; as measured
        - action: vector (J,), the action in use; ACTION_SCALE
        output_ports:
        - observation: vector (N,), N the size of the robot's Layout
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * self._joints)
        self._action = self.DeclareVectorInputPort("action", self._joints)
        size = layout_of(robot).size
        self.DeclareVectorOutputPort("observation", size, self._calc)

    def _calc(self, context: Context, output: Any) -> None:
        ahead = preview(self._plan.Eval(context), context.get_time())
        state, action = self._state.Eval(context), self._action.Eval(context)
        output.set_value(observe(self._robot, ahead, state, action))


class TrackingPolicy(LeafSystem):
    """Outputs the mean action of the network for an observation.

    .. pydrake_system::

        name: TrackingPolicy
        input_ports:
        - observation: vector (N,), N the size of the robot's Layout
        output_ports:
        - action: vector (J,); ACTION_SCALE

    :class:`JointTargets` samples it. A policy with a memory (:meth:`Actor.step`) keeps
    it in discrete state: zeros in a default Context, updated every PLAN_DT together
    with the action. Others have neither state nor clock.
    """

    def __init__(self, actor: Actor) -> None:
        super().__init__()
        self._actor = actor
        size = actor.layout.size
        self._observation = self.DeclareVectorInputPort("observation", size)
        self._nothing = np.zeros(0)
        prerequisites = {self._observation.ticket()}
        if actor.memory_size:
            self._memory = self.DeclareDiscreteState(np.zeros(actor.memory_size))
            prerequisites.add(self.discrete_state_ticket(self._memory))
            # Unrestricted, so that the observation is still the one that was acted on:
            # JointTargets changes the last action in the same phase.
            self.DeclarePeriodicUnrestrictedUpdateEvent(PLAN_DT, 0.0, self._remember)
        # Action and next memory are computed together, and needed by two.
        self._step = self.DeclareCacheEntry(
            "step",
            ValueProducer(
                allocate=lambda: AbstractValue.Make(()), calc=self._calc_step
            ),
            prerequisites,
        )
        joints = len(actor.config.mirror_joints)
        self.DeclareVectorOutputPort(
            "action", joints, self._calc, {self._step.ticket()}
        )

    def _calc_step(self, context: Context, output: AbstractValue) -> None:
        memory = self._nothing
        if self._actor.memory_size:
            memory = context.get_discrete_state(self._memory).value()
        output.set_value(act(self._actor, self._observation.Eval(context), memory))

    def _calc(self, context: Context, output: Any) -> None:
        output.set_value(self._step.Eval(context)[0])

    def _remember(self, context: Context, state: State) -> None:
        memory = self._step.Eval(context)[1]
        state.get_mutable_discrete_state(self._memory).set_value(memory)


class JointTargets(PlanFollower):
    """Computes the PD set-points at 50 Hz and holds them in between.

    .. pydrake_system::

        name: JointTargets
        input_ports:
        - plan: abstract, Plan
        - action: vector (J,); ACTION_SCALE
        output_ports:
        - desired_state: vector (2 J,), [q_d, 0]; rad, rad/s
        - action: vector (J,), the action in use; ACTION_SCALE

    Every PLAN_DT the system samples its inputs and computes :func:`joint_targets` from
    the action and from the plan's :func:`set_points` at t + PLAN_DT. Drake performs
    this unrestricted update before the plant's discrete update at the same time, so an
    action takes effect without delay.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        still = 0 * robot.stand_joints
        self._action = self.DeclareVectorInputPort("action", self._joints)
        targets = joint_targets(robot.stand_joints, still)
        self._targets = self.DeclareDiscreteState(targets)
        self._held = self.DeclareDiscreteState(still)
        # State output ports call no Python while the plant steps.
        self.DeclareStateOutputPort("desired_state", self._targets)
        self.DeclareStateOutputPort("action", self._held)
        self.DeclarePeriodicUnrestrictedUpdateEvent(PLAN_DT, 0.0, self._sample)

    def _sample(self, context: Context, state: State) -> None:
        plan = self._plan.Eval(context)
        action = self._action.Eval(context)
        due = set_points(self._robot, plan)[plan.index(context.get_time() + PLAN_DT)]
        targets = joint_targets(due, action)
        state.get_mutable_discrete_state(self._targets).set_value(targets)
        state.get_mutable_discrete_state(self._held).set_value(action)


class TrackingReward(PlanFollower):
    """Outputs the terms of the reward, see :func:`reward_terms`.

    .. pydrake_system::

        name: TrackingReward
        input_ports:
        - plan: abstract, Plan
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s
        output_ports:
        - reward_terms: vector (5,), weighted; see REWARD_TERMS
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * self._joints)
        self.DeclareVectorOutputPort("reward_terms", len(REWARD_TERMS), self._calc)

    def _calc(self, context: Context, output: Any) -> None:
        plan, k = self._now(context)
        state = self._state.Eval(context)
        terms = reward_terms(self._robot, plan.state[k], plan.p_BoF_H[k], state)
        output.set_value(terms)
