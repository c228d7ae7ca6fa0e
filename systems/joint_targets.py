"""From the policy's action to the set-points of the joints' PD controllers."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, EventStatus, LeafSystem, State

from loco_drake.models.robots import Robot

from .plan import PLAN_DT, standing_plan

ACTION_SCALE = 0.15  # rad per unit of action: 15 Nm on both robots


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

    Every PLAN_DT it samples its inputs and sets

        q_d = set_points + ACTION_SCALE * action

    with the plan's set-points at t + PLAN_DT, which hold its positions, velocities and
    feed-forward torques: the desired velocity is sent as zero, since Drake's CENIC
    integrator (1.51) takes it with the wrong sign; the torque kp (q_d - q) - kd v is
    the same either way. The sampling is an unrestricted update, which Drake
    performs before the plant's discrete update at the same time: the action reaches
    the joints without delay. The output ``action`` is the one being held.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._size = len(robot.joint_names)
        self._plan = self.DeclareAbstractInputPort("plan", Value(standing_plan(robot)))
        self._action = self.DeclareVectorInputPort("action", self._size)
        # The action, the desired positions, and the desired velocities, which are zero.
        self._held = self.DeclareDiscreteState(
            np.concatenate(
                (np.zeros(self._size), robot.stand_joints, np.zeros(self._size))
            )
        )
        state = {self.discrete_state_ticket(self._held)}
        self.DeclareVectorOutputPort(
            "desired_state",
            2 * self._size,
            self._calc_desired_state,
            prerequisites_of_calc=state,
        )
        self.DeclareVectorOutputPort(
            "action", self._size, self._calc_action, prerequisites_of_calc=state
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=PLAN_DT, offset_sec=0.0, update=self._sample
        )

    def _sample(self, context: Context, state: State) -> EventStatus:
        plan = self._plan.Eval(context)
        action = self._action.Eval(context)
        k = plan.index(context.get_time() + PLAN_DT)
        held = state.get_mutable_discrete_state(int(self._held)).get_mutable_value()
        held[: self._size] = action
        held[self._size : 2 * self._size] = plan.set_points[k] + ACTION_SCALE * action
        return EventStatus.Succeeded()

    def _calc_desired_state(self, context: Context, output: Any) -> None:
        held = context.get_discrete_state(int(self._held)).value()
        output.set_value(held[self._size :])

    def _calc_action(self, context: Context, output: Any) -> None:
        held = context.get_discrete_state(int(self._held)).value()
        output.set_value(held[: self._size])
