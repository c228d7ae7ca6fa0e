"""In what an episode's world differs from the model: a domain, and how it is set.

Domain randomization (Tobin et al. 2017; Tan et al. 2018, "Sim-to-real") draws a domain
for each episode. All of it lives in the Context: parameters of plant and scene graph,
and the parameter of three systems that a diagram holds only if its scenario asks for
them, :class:`Actuation`, :class:`Pushes` and :class:`Sensors`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import (
    AbstractParameterIndex,
    Context,
    Diagram,
    DiscreteValues,
    EventStatus,
    LeafSystem,
)

from loco_drake.common.errors import InputError
from loco_drake.control.domain import MAX_LATENCY, Domain
from loco_drake.control.measurement import draw_error, measure
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import JOINT_VELOCITIES, JOINTS, split
from loco_drake.models.ground import SetGround
from loco_drake.models.parameters import (
    SetReflectedInertia,
    SetTrunkLoad,
    check_strength,
    surplus_inertia,
)
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import Robot

Array = NDArray[np.float64]

DISTURBING_SYSTEMS = ("actuation", "pushes", "sensors")
_TOLERANCE = 1e-6  # s, or of a sample; context times are sums of steps


class DomainSystem(LeafSystem):
    """A system with a domain as its parameter; by default, one like the model."""

    def __init__(self) -> None:
        super().__init__()
        self._index = AbstractParameterIndex(
            self.DeclareAbstractParameter(Value(Domain()))
        )
        self._domain_ticket = self.abstract_parameter_ticket(self._index)

    def SetDomain(self, context: Context, domain: Domain) -> None:
        """Sets the domain; ``context`` is this system's own."""
        context.get_mutable_abstract_parameter(self._index).set_value(domain)

    def _domain(self, context: Context) -> Domain:
        return context.get_abstract_parameter(self._index).get_value()


class Actuation(DomainSystem):
    """Turns wanted set-points into those that make the plant's PD act as its motors do.

    .. pydrake_system::

        name: Actuation
        input_ports:
        - desired_state: for the PD as modelled, [q_d, 0], rad and rad/s, size 2 J
        - state: [q, v] of the robot, size 13 + 2 J; m, rad, s
        output_ports:
        - desired_state: for the plant's PD, the same

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
            q, v = split(self._state.Eval(context))
            rest = q[JOINTS] + self._prediction * v[JOINT_VELOCITIES]
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


class Pushes(DomainSystem):
    """Outputs the forces of its domain's pushes.

    .. pydrake_system::

        name: Pushes
        output_ports:
        - spatial_forces: list of ExternallyAppliedSpatialForce, N, expressed in W

    A discrete plant samples them at the beginning of its steps: a push that begins and
    lasts whole steps gives the trunk exactly the impulse force times duration.

    Args:
        trunk: the body to push.
    """

    def __init__(self, trunk: BodyIndex) -> None:
        super().__init__()
        self._trunk = trunk
        self.DeclareAbstractOutputPort(
            "spatial_forces",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc,
            prerequisites_of_calc={self.time_ticket(), self._domain_ticket},
        )

    def _calc(self, context: Context, output: Any) -> None:
        time = context.get_time() + _TOLERANCE
        forces = []
        for push in self._domain(context).pushes:
            if push.start <= time < push.start + push.duration:
                force = ExternallyAppliedSpatialForce()
                force.body_index = self._trunk
                force.p_BoBq_B = np.zeros(3)
                force.F_Bq_W = SpatialForce(tau=np.zeros(3), f=push.force_W)
                forces.append(force)
        output.set_value(forces)


class Sensors(DomainSystem):
    """Outputs the state with the errors of its domain, new ones every PLAN_DT.

    .. pydrake_system::

        name: Sensors
        input_ports:
        - state: [q, v] of the robot, size 13 + 2 J; m, rad, s
        output_ports:
        - state: the same as it is measured
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        size = 13 + 2 * len(robot.joint_names)
        self._state = self.DeclareVectorInputPort("state", size)
        self.DeclareVectorOutputPort(
            "state",
            size,
            self._calc,
            prerequisites_of_calc={
                self.time_ticket(),
                self._state.ticket(),
                self._domain_ticket,
            },
        )

    def _calc(self, context: Context, output: Any) -> None:
        state = self._state.Eval(context)
        errors = self._domain(context).sensors
        if errors is not None:
            sample = int(context.get_time() / PLAN_DT + _TOLERANCE)
            state = measure(state, draw_error(errors, sample))
        output.set_value(state)


def SetDomain(diagram: Diagram, context: Context, domain: Domain) -> None:
    """Puts a locomotion diagram's Context into ``domain``.

    Ground, trunk and rotors, where the domain does not give them, stay as they are in
    ``context``.

    Args:
        diagram: holds the systems of :func:`.diagram.AddLocomotion`, among them the
            disturbances that the domain has.
        context: the diagram's.
        domain: the domain.

    Raises:
        InputError: if the diagram lacks a system that the domain needs.
    """
    for name in DISTURBING_SYSTEMS:
        if domain.needs(name) and not diagram.HasSubsystemNamed(name):
            raise InputError(
                f"This domain needs a scenario with the disturbance {name}: "
                f"Scenario(disturbances=Disturbances({name}=True))."
            )
    plant = diagram.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    robot = diagram.GetSubsystemByName("robot_state").robot
    instance = plant.GetModelInstanceByName(robot.name)
    if domain.friction is not None or domain.stiffness is not None:
        scene_graph = diagram.GetSubsystemByName("scene_graph")
        SetGround(
            plant,
            scene_graph,
            scene_graph.GetMyMutableContextFromRoot(context),
            friction=domain.friction,
            stiffness=domain.stiffness,
        )
    if domain.payload is not None or domain.com_shift is not None:
        SetTrunkLoad(
            plant.GetBodyByName(robot.trunk_frame, instance),
            plant_context,
            mass=domain.payload or 0.0,
            p_shift_B=np.zeros(3) if domain.com_shift is None else domain.com_shift,
        )
    if domain.strength is not None:
        actuation = diagram.GetSubsystemByName("actuation")
        inertia = actuation.reflected_inertia(domain.strength)
        SetReflectedInertia(plant, instance, plant_context, inertia)
    for name in DISTURBING_SYSTEMS:
        if diagram.HasSubsystemNamed(name):
            system = diagram.GetSubsystemByName(name)
            system.SetDomain(system.GetMyMutableContextFromRoot(context), domain)
