"""Systems and functions that simulate a world unlike the model.

Domain randomization (Tobin et al. 2017; Tan et al. 2018, "Sim-to-real") draws a Domain
for each episode. A Domain is stored in the Context: in parameters of plant and scene
graph, and in a parameter of the systems :class:`Actuation`, :class:`Pushes` and
:class:`Sensors`, which the diagram contains only if its scenario asks for them.
"""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, Diagram, DiscreteValues, LeafSystem

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.control.domain import MAX_LATENCY, Domain, draw_error, measure
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import JOINT_VELOCITIES, JOINTS, split, unit_base
from loco_drake.control.terrain import Terrain, toes_in_world
from loco_drake.models.ground import SetGround
from loco_drake.models.movable_ground import (
    HasMovableGround,
    PlaceStep,
    PlaceToePlanes,
    TiltGround,
)
from loco_drake.models.parameters import (
    SetReflectedInertia,
    SetTrunkLoad,
    check_strength,
    surplus_inertia,
)
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import Robot, SimulatedRobot

from .control import FindRobot

DISTURBING_SYSTEMS = ("actuation", "pushes", "sensors")
# Speed at which a joint has three quarters of its Coulomb friction, rad/s.
_FRICTION_SPEED = 0.2
_TOLERANCE = 1e-6  # s, or of a sample; context times are sums of steps


class DomainSystem(LeafSystem):
    """Base of systems that have a Domain as their parameter."""

    def __init__(self) -> None:
        super().__init__()
        self._index = self.DeclareAbstractParameter(Value(Domain()))

    def SetDomain(self, context: Context, domain: Domain) -> None:
        """Sets the domain in ``context``, which is this system's own."""
        context.get_mutable_abstract_parameter(self._index).set_value(domain)

    def _domain(self, context: Context) -> Domain:
        return context.get_abstract_parameter(self._index).get_value()


class Actuation(DomainSystem):
    """Simulates unlike motors and joint friction by changing the PD set-points.

    .. pydrake_system::

        name: Actuation
        input_ports:
        - desired_state: vector (2 J,), [q_d, 0] of the nominal motors; rad, rad/s
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s
        output_ports:
        - desired_state: vector (2 J,), [q_d', 0] for the plant; rad, rad/s

    *Latency.* Set-points are delayed by n = latency / time_step steps of the plant: the
    step that begins at t uses those of t - n time_step, or the first ones at the start.

    *Strength.* Drake stores PD gains and effort limits outside the Context, but the
    torque of the PD is linear in the set-point. In a step of length h it is
    kp (q_d - q) - kd v', with q and v at the beginning of the step, v' at its end and
    the motors' kd, see :func:`loco_drake.models.plant.plant_damping`. For strength s
    the set-point

        q_d' = s q_d + (1 - s) (q + kd / kp v)

    makes it

        s (kp (q_d - q) - kd v') - (1 - s) kd (v' - v).

    The first term is s times the nominal torque. The second acts like an inertia
    (1 - s) kd h, which SetDomain subtracts from the rotor inertia. The joints then move
    as with the gains s kp and s kd. The plant's port net_actuation contains
    both terms. Under "cenic" h is 0, and the rotor inertia does not change. The effort
    limits do not change either: a weak motor has less torque at the same command, but
    the same maximum.

    *Damping.* For damping d, relative to the model's, s (1 - d) kd / kp v is added to
    the set-point and s (1 - d) kd h subtracted from the rotor inertia. The joints then
    move as with the gains s kp and s d kd.

    *Joint friction.* Coulomb's torque -f sign(v) is added to that of the PD, with
    tanh(v / .2 rad/s) for sign(v) and v at the beginning of a step. It does not hold a
    joint that stands: the PD does. In a step of 10 ms the largest f changes v by less
    than .2 rad/s, since the damped step resists like an inertia kd h, and joints come
    to rest without chatter.
    """

    def __init__(self, robot: Robot, plant: PlantConfig) -> None:
        super().__init__()
        self._robot, self._plant = robot, plant
        self._joints = joints = len(robot.joint_names)
        self._prediction = robot.kd / robot.kp
        self._desired = self.DeclareVectorInputPort("desired_state", 2 * joints)
        self._state = self.DeclareVectorInputPort("state", 13 + 2 * joints)
        # Set-points of recent steps, newest first; NaN before the first.
        rows = round(MAX_LATENCY / plant.time_step) + 1
        self._past = self.DeclareDiscreteState(np.full(rows * joints, np.nan))
        self.DeclarePeriodicDiscreteUpdateEvent(plant.time_step, 0.0, self._remember)
        self.DeclareVectorOutputPort("desired_state", 2 * joints, self._calc)

    def reflected_inertia(self, damping: Array) -> Array:
        """Returns the rotor inertia at the joints, kg m^2, (12,).

        ``damping`` is that of each motor over its model's: s d as above.

        Raises:
            InputError: if a motor is weaker than
                :func:`loco_drake.models.parameters.least_strength`.
        """
        check_strength(self._robot, self._plant, float(np.min(damping)))
        surplus = surplus_inertia(self._robot, self._plant)
        return self._robot.reflected_inertia - (1 - damping) * surplus

    def SetPast(self, context: Context, q_d: Array) -> None:
        """Sets all set-points that ``context``, this system's own, remembers, (J,)."""
        past = context.get_mutable_discrete_state(self._past)
        past.SetFromVector(np.tile(q_d, past.size() // self._joints))

    def _remember(self, context: Context, values: DiscreteValues) -> None:
        if self._domain(context).latency == 0:
            return
        past = values.get_mutable_value(self._past).reshape(-1, self._joints)
        first = np.isnan(past[0, 0])
        past[1:] = past[:-1].copy()
        past[: len(past) if first else 1] = self._desired.Eval(context)[: self._joints]

    def _calc(self, context: Context, output: Any) -> None:
        domain = self._domain(context)
        q_d = self._delayed(context, domain)
        if domain.strength is not None:
            q, v = self._joint_state(context)
            rest = q + self._prediction * v
            q_d = domain.strength * q_d + (1 - domain.strength) * rest
        if domain.damping is not None:
            _, v = self._joint_state(context)
            share = 1.0 if domain.strength is None else domain.strength
            q_d = q_d + share * (1 - domain.damping) * self._prediction * v
        if domain.joint_friction > 0:
            _, v = self._joint_state(context)
            friction = domain.joint_friction * np.tanh(v / _FRICTION_SPEED)
            q_d = q_d - friction / self._robot.kp
        output.set_value(np.concatenate((q_d, np.zeros(self._joints))))

    def _joint_state(self, context: Context) -> tuple[Array, Array]:
        q, v = split(self._state.Eval(context))
        return q[JOINTS], v[JOINT_VELOCITIES]

    def _delayed(self, context: Context, domain: Domain) -> Array:
        now = self._desired.Eval(context)[: self._joints]
        steps = round(domain.latency / self._plant.time_step)
        if steps == 0:
            return now
        past = context.get_discrete_state(self._past).value().reshape(-1, self._joints)
        # A discrete plant steps together with _remember and sees the state before it; a
        # continuous plant steps after it.
        value = past[steps if self._plant.contact == "cenic" else steps - 1]
        return now if np.isnan(value[0]) else value


class Pushes(DomainSystem):
    """Outputs the external forces of the domain's pushes.

    .. pydrake_system::

        name: Pushes
        output_ports:
        - spatial_forces: abstract, list[ExternallyAppliedSpatialForce], in W; N, N m

    A discrete plant samples the forces at the beginning of its steps. A push that
    starts at a step and lasts whole steps has exactly the impulse force times duration.
    """

    def __init__(self, trunk: BodyIndex) -> None:
        super().__init__()
        self._trunk = trunk
        self.DeclareAbstractOutputPort(
            "spatial_forces",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc,
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
    """Outputs the measured state, with new sensor noise every PLAN_DT.

    .. pydrake_system::

        name: Sensors
        input_ports:
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s
        output_ports:
        - state: vector (13 + 2 J,), [q, v]; m, rad, m/s, rad/s; as measured
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__()
        size = 13 + 2 * len(robot.joint_names)
        self._state = self.DeclareVectorInputPort("state", size)
        self.DeclareVectorOutputPort("state", size, self._calc)

    def _calc(self, context: Context, output: Any) -> None:
        state = self._state.Eval(context)
        errors = self._domain(context).sensors
        if errors is not None:
            sample = int(context.get_time() / PLAN_DT + _TOLERANCE)
            state = measure(state, draw_error(errors, sample))
        output.set_value(state)


def SetDomain(diagram: Diagram, context: Context, domain: Domain) -> None:
    """Sets a domain in the Context of a locomotion diagram.

    Ground, trunk and rotors that the domain does not specify keep their values. The
    diagram contains the systems of :func:`.diagram.AddLocomotion`.

    Raises:
        InputError: if the diagram lacks a disturbance that the domain needs.
    """
    robot, plant, instance = FindRobot(diagram)
    present = {name for name in DISTURBING_SYSTEMS if diagram.HasSubsystemNamed(name)}
    if HasMovableGround(plant):
        present.add("terrain")
    for name in (*DISTURBING_SYSTEMS, "terrain"):
        if domain.needs(name) and name not in present:
            raise InputError(
                f"This domain needs a scenario with the disturbance {name}: "
                f"Scenario(disturbances=Disturbances({name}=True))."
            )
    plant_context = plant.GetMyMutableContextFromRoot(context)
    if domain.friction is not None or domain.stiffness is not None:
        scene_graph = diagram.GetSubsystemByName("scene_graph")
        ground = scene_graph.GetMyMutableContextFromRoot(context)
        contact = {"friction": domain.friction, "stiffness": domain.stiffness}
        SetGround(plant, scene_graph, ground, **contact)
    if "terrain" in present:
        level = Terrain(gradient=np.zeros(2))
        terrain = domain.terrain or level
        TiltGround(plant, plant_context, terrain.gradient)
        PlaceStep(plant, plant_context, terrain.step, terrain.step_x)
        state = diagram.GetSubsystemByName("robot_state")
        state.SetTerrain(state.GetMyMutableContextFromRoot(context), domain.terrain)
    if domain.payload is not None or domain.com_shift is not None:
        trunk = plant.GetBodyByName(robot.trunk_frame, instance)
        shift = np.zeros(3) if domain.com_shift is None else domain.com_shift
        mass = domain.payload or 0.0
        SetTrunkLoad(trunk, plant_context, mass=mass, p_shift_B=shift)
    if domain.strength is not None or domain.damping is not None:
        actuation = diagram.GetSubsystemByName("actuation")
        strength = np.ones(12) if domain.strength is None else domain.strength
        damping = 1.0 if domain.damping is None else domain.damping
        inertia = actuation.reflected_inertia(strength * damping)
        SetReflectedInertia(plant, instance, plant_context, inertia)
    for name in present - {"terrain"}:
        system = diagram.GetSubsystemByName(name)
        system.SetDomain(system.GetMyMutableContextFromRoot(context), domain)


def FollowTerrain(diagram: Diagram, context: Context) -> None:
    """Moves the ground under each toe to where the toe is, if the ground has bumps.

    To be called at the start of each control period: no system can change parameters of
    another. In a period of 20 ms a plane departs from the bumps by fractions of a mm
    under a toe that stands, by a few mm under one that swings.
    """
    terrain = GetTerrain(diagram, context)
    if terrain is None or terrain.roughness == 0:
        return
    robot, plant, instance = FindRobot(diagram)
    plant_context = plant.GetMyMutableContextFromRoot(context)
    q = unit_base(np.asarray(plant.GetPositions(plant_context, instance)))
    p_WF = toes_in_world(robot, q)
    heights, gradients = terrain.surface(p_WF[:, :2])
    points = np.column_stack((p_WF[:, :2], heights))
    PlaceToePlanes(plant, plant_context, points, gradients)


def GetTerrain(diagram: Diagram, context: Context) -> Terrain | None:
    """Returns the terrain of a locomotion diagram in its root's ``context``."""
    state = diagram.GetSubsystemByName("robot_state")
    terrain: Terrain | None = state.GetTerrain(state.GetMyContextFromRoot(context))
    return terrain
