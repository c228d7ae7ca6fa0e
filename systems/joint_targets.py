"""The system that sends set-points to the joints' PD controllers."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, EventStatus, LeafSystem, State

from loco_drake.control.action import joint_targets, set_points
from loco_drake.control.plan import PLAN_DT, standing_plan
from loco_drake.models.robots import Robot


class JointTargets(LeafSystem):
    """Holds, for one control period, the reference plus the policy's correction.

    .. pydrake_system::

        name: JointTargets
        input_ports:
        - plan
        - action
        output_ports:
        - desired_state
        - action

    Every PLAN_DT it samples its inputs and sets :func:`joint_targets` of the action and
    of the plan's set-points at t + PLAN_DT, which hold the plan's positions, velocities
    and feed-forward torques. The sampling is an unrestricted update, which Drake
    performs before the plant's discrete update at the same time: the action reaches
    the joints without delay. The output ``action`` is the one being held.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._robot = robot
        size = len(robot.joint_names)
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))
        self._action = self.DeclareVectorInputPort("action", size)
        still = np.zeros(size)
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
