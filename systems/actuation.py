"""Motors that are late, or stronger or weaker than their model."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, EventStatus

from loco_drake.control.domain import Domain
from loco_drake.models.parameters import check_strength, surplus_inertia
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import Robot

from .domain import DomainSystem

Array = NDArray[np.float64]

MAX_LATENCY = 0.1  # s


class Actuation(DomainSystem):
    """Turns wanted set-points into those that make the plant's PD act as its motors do.

    .. pydrake_system::

        name: Actuation
        input_ports:
        - desired_state
        - state
        output_ports:
        - desired_state

    *Latency.* Set-points come out n = latency / time_step steps of the physics after
    they came in: a step that begins at t uses those of t - n time_step, and until there
    are such, the first ones.

    *Strength.* Gains and effort limits of Drake's PD are not in the Context. But its
    torque kp (q_d - q) - kd v is linear in the set-point. With q and v at the beginning
    of a step and h its length,

        q_d' = s q_d + (1 - s) (q + (h + kd / kp) v)

    makes the PD, which is implicit and acts on the velocity v' at the end of the step
    and on q + h v', give

        s (kp (q_d - q - h v') - kd v') - (1 - s) (kd + kp h) (v' - v):

    s times its torque, and a term like the inertia (1 - s) (kd + kp h) h. SetDomain
    takes that off the rotors' inertia, so that the joints move as with gains of s kp
    and s kd; the output port net_actuation of the plant still has both terms. Under
    "cenic" h is 0 here, and the rotors stay as they are. Effort limits stay: a weak
    motor has less torque for the same command, and the same maximum.

    Args:
        robot: the robot.
        plant: time step and contact.
    """

    def __init__(self, robot: Robot, plant: PlantConfig) -> None:
        super().__init__()
        size = len(robot.joint_names)
        self._size = size
        self._time_step = plant.time_step
        self._continuous = plant.contact == "cenic"
        h = 0.0 if self._continuous else plant.time_step
        self._prediction = h + robot.kd / robot.kp
        self._robot, self._plant = robot, plant
        self._surplus = surplus_inertia(robot, plant)
        self._desired = self.DeclareVectorInputPort("desired_state", 2 * size)
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * size)
        # The set-points of the latest steps, the last one first; NaN before the first.
        rows = round(MAX_LATENCY / plant.time_step) + 1
        self._past = self.DeclareDiscreteState(np.full(rows * size, np.nan))
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=plant.time_step, offset_sec=0.0, update=self._remember
        )
        self.DeclareVectorOutputPort(
            "desired_state",
            2 * size,
            self._calc,
            prerequisites_of_calc={
                self._desired.ticket(),
                self._state.ticket(),
                self.discrete_state_ticket(self._past),
                self._domain_ticket,
            },
        )

    def reflected_inertia(self, strength: Array) -> Array:
        """Returns the rotors' inertia at joints for this strength, kg m^2, (12,).

        Raises:
            InputError: if a motor is weaker than
                :func:`loco_drake.models.parameters.least_strength`.
        """
        check_strength(self._robot, self._plant, float(np.min(strength)))
        return self._robot.reflected_inertia - (1 - strength) * self._surplus

    def _remember(self, context: Context, values: DiscreteValues) -> EventStatus:
        if self._domain(context).latency == 0:
            return EventStatus.DidNothing()
        past = values.get_mutable_value(int(self._past))
        now = self._desired.Eval(context)[: self._size]
        if np.isnan(past[0]):
            past[:] = np.tile(now, len(past) // self._size)
        else:
            past[self._size :] = past[: -self._size].copy()
            past[: self._size] = now
        return EventStatus.Succeeded()

    def _calc(self, context: Context, output: Any) -> None:
        domain = self._domain(context)
        q_d = self._delayed(context, domain)
        if domain.strength is not None:
            state = self._state.Eval(context)
            q, v = state[7 : 7 + self._size], state[13 + self._size :]
            rest = q + self._prediction * v
            q_d = domain.strength * q_d + (1 - domain.strength) * rest
        output.set_value(np.concatenate((q_d, np.zeros(self._size))))

    def _delayed(self, context: Context, domain: Domain) -> Array:
        now = self._desired.Eval(context)[: self._size]
        steps = round(domain.latency / self._time_step)
        if steps == 0:
            return now
        past = context.get_discrete_state(int(self._past)).value()
        # A discrete plant steps together with _remember, from what was there before; a
        # continuous one after it.
        first = (steps if self._continuous else steps - 1) * self._size
        value = past[first : first + self._size]
        return now if np.isnan(value[0]) else value
