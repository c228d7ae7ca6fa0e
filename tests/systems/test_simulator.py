from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder, EventStatus, LeafSystem

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_multiply, quat_to_matrix
from loco_drake.control.domain import Domain
from loco_drake.control.plan import PLAN_DT, plan_from_motion
from loco_drake.control.state import split, unit_base
from loco_drake.models.plant import CONTACTS, PlantConfig
from loco_drake.motion.gaits import parse_label
from loco_drake.systems.diagram import AddLocomotion, MakeLocomotionDiagram
from loco_drake.systems.domain import SetDomain
from loco_drake.systems.scenario import (
    Disturbances,
    GeneratedReference,
    PlanReference,
    Scenario,
)
from loco_drake.systems.simulator import MakeSimulator, StartEpisode
from tests.synthetic_motion import synthetic_motion

PLAYED = Scenario(
    reference=PlanReference(), disturbances=Disturbances(actuation=True, sensors=True)
)


@pytest.fixture(scope="module")
def played():
    return MakeLocomotionDiagram(PLAYED)


@pytest.fixture(scope="module")
def pace(go2):
    """Three seconds of a slow pace that begins elsewhere than the trot."""
    plan = plan_from_motion(go2, synthetic_motion("dog-pace", 3.0, 0.3))
    q = plan.q.copy()
    q[:, 4] += 2.0
    return replace(plan, q=q)


def run(simulator, diagram, until):
    simulator.AdvanceTo(until)
    context = diagram.GetMyContextFromRoot(simulator.get_mutable_context())
    return diagram.GetOutputPort("state").Eval(context).copy()


def test_an_episode_after_others_is_what_a_new_diagram_does(played, trot, pace):
    """To the last bit, whatever was simulated before, in whatever world."""
    fresh = MakeSimulator(MakeLocomotionDiagram(PLAYED), PLAYED)
    StartEpisode(fresh, plan=pace)
    expected = run(fresh, fresh.get_system(), 0.7)

    used = MakeSimulator(played, PLAYED)
    domain = Domain(friction=0.2, payload=2.0, latency=0.02)
    StartEpisode(used, plan=trot, domain=domain)
    run(used, played, 0.5)
    StartEpisode(used, plan=pace)
    np.testing.assert_array_equal(run(used, played, 0.7), expected)


def test_gait_and_seed_of_an_episode_are_those_of_a_scenario():
    scenario = Scenario(reference=GeneratedReference(gait="dog-pace", seed=2))
    direct = MakeSimulator(MakeLocomotionDiagram(scenario), scenario)
    StartEpisode(direct)
    expected = run(direct, direct.get_system(), 0.3)

    scenario.reference = GeneratedReference(gait="dog-trot", seed=1)
    other = MakeSimulator(MakeLocomotionDiagram(scenario), scenario)
    StartEpisode(other)
    assert (run(other, other.get_system(), 0.3) != expected).any()
    StartEpisode(other, gait="dog-pace", seed=2)
    np.testing.assert_array_equal(run(other, other.get_system(), 0.3), expected)
    with pytest.raises(InputError, match="takes no plan: a Generated"):
        StartEpisode(other, plan=plan_from_motion)


@pytest.mark.parametrize("smoother", [True, False])
def test_a_plan_that_is_set_on_the_way_is_followed(trot, pace, smoother):
    """From the next update of the smoother on, though it had smoothed another one."""
    scenario = replace(PLAYED, **({} if smoother else {"smoother": None}))
    diagram = MakeLocomotionDiagram(scenario)
    simulator = MakeSimulator(diagram, scenario)
    StartEpisode(simulator, plan=trot)
    simulator.AdvanceTo(0.5)
    player = diagram.GetSubsystemByName("reference")
    context = simulator.get_mutable_context()
    player.SetPlan(player.GetMyMutableContextFromRoot(context), pace)
    simulator.AdvanceTo(0.6)
    plan = diagram.GetOutputPort("plan").Eval(context)
    q = plan.q[plan.index(0.6)]
    assert np.abs(pace.q - q).max(axis=1).min() < 1e-9
    assert np.abs(trot.q - q).max(axis=1).min() > 0.1


def test_another_motion_that_is_generated_on_the_way_is_followed():
    """The smoother, which had gone on for seconds, begins it too."""
    scenario = Scenario(reference=GeneratedReference(gait="dog-pace", seed=1))
    diagram = MakeLocomotionDiagram(scenario)
    simulator = MakeSimulator(diagram, scenario)
    StartEpisode(simulator)
    simulator.AdvanceTo(1.0)
    context = simulator.get_mutable_context()
    reference = diagram.GetSubsystemByName("reference")
    own = reference.GetMyMutableContextFromRoot(context)
    reference.SetReference(own, gait="horse-walk", seed=2)
    simulator.AdvanceTo(1.4)
    plan = diagram.GetOutputPort("plan").Eval(context)
    ahead = plan.labels[plan.index(1.4) : plan.index(2.2)]
    assert (ahead == parse_label("horse-walk").index).all()
    assert plan.end_time > 2.2


def test_what_the_reference_cannot_take_is_refused(played):
    simulator = MakeSimulator(played, PLAYED)
    with pytest.raises(InputError, match=r"takes no gait: .*PlanReference takes plan"):
        StartEpisode(simulator, gait="dog-trot")


def test_a_continuous_plant_is_integrated_by_cenic_or_not_at_all(trot):
    """Runge and Kutta would take half a million steps for .4 s, and say nothing."""
    scenario = replace(PLAYED, plant=PlantConfig(contact="cenic"))
    diagram = MakeLocomotionDiagram(scenario)
    with pytest.raises(InputError, match=r"runge_kutta3 .*MakeSimulator"):
        StartEpisode(Simulator(diagram), plan=trot)
    simulator = MakeSimulator(diagram, scenario)
    StartEpisode(simulator, plan=trot)
    run(simulator, diagram, 0.1)
    assert simulator.get_num_steps_taken() < 200
    with pytest.raises(InputError, match="not made of this scenario"):
        MakeSimulator(diagram, PLAYED)


class Odometer(LeafSystem):
    """Somebody's own system, which takes the robot's state."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("state", 37)
        self.DeclareVectorOutputPort("x", 1, self._calc)

    def _calc(self, context, output):
        output[0] = self.GetInputPort("state").Eval(context)[4]


def add_box(plant, scene_graph):
    """Somebody's own body: a cube of 1 kg, dropped beside the robot."""
    inertia = SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidCube(0.2))
    box = plant.AddRigidBody("base", plant.AddModelInstance("box"), inertia)
    friction = CoulombFriction(0.8, 0.8)
    plant.RegisterCollisionGeometry(
        box, RigidTransform(), Box(0.2, 0.2, 0.2), "box", friction
    )
    plant.SetDefaultFloatingBaseBodyPose(box, RigidTransform([0.0, 3.0, 0.15]))
    wall = Box(0.1, 1.0, 1.0)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform([9.0, 0, 0]), wall, "wall", friction
    )


@pytest.mark.parametrize("contact", CONTACTS)
def test_a_diagram_of_ones_own_with_a_body_of_ones_own(trot, contact):
    """The box falls to rest, the robot starts on its plan, the odometer counts."""
    scenario = replace(
        PLAYED,
        plant=PlantConfig(contact=contact),
        disturbances=Disturbances(actuation=True, pushes=True),
    )
    builder = DiagramBuilder()
    made = AddLocomotion(builder, scenario, pre_finalize=add_box)
    odometer = builder.AddSystem(Odometer())
    builder.Connect(made.outputs["state"], odometer.GetInputPort("state"))
    builder.ExportOutput(odometer.GetOutputPort("x"), "x")
    diagram = builder.Build()
    simulator = MakeSimulator(diagram, scenario)
    for _ in range(2):
        StartEpisode(
            simulator,
            plan=trot,
            domain=Domain(friction=0.7, payload=1.0, strength=np.full(12, 0.95)),
        )
        context = simulator.get_mutable_context()
        assert diagram.GetOutputPort("x").Eval(context) == trot.q[0, 4]
        simulator.AdvanceTo(1.0)
        x = diagram.GetOutputPort("x").Eval(context)[0]
        # The trot is one of .5 m/s.
        assert 0.25 < x < 0.75
        plant = made.plant
        box = plant.GetBodyByName("base", plant.GetModelInstanceByName("box"))
        X_WBox = plant.EvalBodyPoseInWorld(plant.GetMyContextFromRoot(context), box)
        np.testing.assert_allclose(X_WBox.translation(), [0, 3.0, 0.1], atol=0.02)


@pytest.mark.parametrize("contact", ["similar", "lagged", "sap"])
def test_a_locomotion_diagram_within_another_does_the_same(played, trot, contact):
    """To the last bit; CENIC, which finds no plant there, says what to do instead."""
    scenario = replace(PLAYED, plant=PlantConfig(contact=contact))
    inner = MakeLocomotionDiagram(scenario)
    alone = MakeSimulator(inner, scenario)
    StartEpisode(alone, plan=trot)
    expected = run(alone, inner, 0.4)
    builder = DiagramBuilder()
    builder.AddSystem(Odometer())
    builder.AddSystem(inner)
    simulator = MakeSimulator(builder.Build(), scenario)
    StartEpisode(simulator, plan=trot)
    np.testing.assert_array_equal(run(simulator, inner, 0.4), expected)


def test_what_cannot_be_simulated_is_refused_with_what_can():
    scenario = replace(PLAYED, plant=PlantConfig(contact="cenic"))
    builder = DiagramBuilder()
    builder.AddSystem(MakeLocomotionDiagram(scenario))
    with pytest.raises(InputError, match=r"AddLocomotion, or use contact similar"):
        MakeSimulator(builder.Build(), scenario)
    builder = DiagramBuilder()
    builder.AddSystem(Odometer())
    with pytest.raises(InputError, match="no locomotion in it"):
        MakeSimulator(builder.Build(), scenario)
    builder = DiagramBuilder()
    AddLocomotion(builder, PLAYED)
    with pytest.raises(InputError, match="has a system named plant already"):
        AddLocomotion(builder, PLAYED)


def test_the_rate_is_the_scenarios_and_the_integrator_the_plants(played):
    config = SimulatorConfig(target_realtime_rate=2.0)
    simulator = MakeSimulator(played, replace(PLAYED, simulator=config))
    assert simulator.get_target_realtime_rate() == 2.0
    config.integration_scheme = "implicit_euler"
    with pytest.raises(InputError, match="only target_realtime_rate can be set"):
        MakeSimulator(played, replace(PLAYED, simulator=config))


def length(simulator, plant):
    context = plant.GetMyContextFromRoot(simulator.get_context())
    return np.linalg.norm(plant.GetPositions(context)[:4])


def test_the_bases_quaternion_keeps_its_length(played, trot):
    """Drake's does not; and where somebody stops on the way makes no difference."""
    plant = played.GetSubsystemByName("plant")
    drake = Simulator(played)
    StartEpisode(drake, plan=trot)
    drake.AdvanceTo(1.0)
    assert length(drake, plant) > 1.0001
    ours = MakeSimulator(played, PLAYED)
    StartEpisode(ours, plan=trot)
    ends = run(ours, played, 1.0)
    assert length(ours, plant) == pytest.approx(1.0, abs=1e-15)
    StartEpisode(ours, plan=trot)
    for time in (0.013, 0.02, 0.2345, 0.24, 0.99, 1.0):
        stopped = run(ours, played, time)
    np.testing.assert_array_equal(stopped, ends)
    # What a simulator of Drake's own sees is of length one all the same.
    seen = played.GetOutputPort("state").Eval(drake.get_context())
    assert np.linalg.norm(seen[:4]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("scale", [0.5, 1 + 1e-9, 1.7, 3.0])
def test_a_scaled_quaternion_is_the_same_rotation(trot, scale):
    """As Drake has it; and to normalize twice is to normalize once."""
    state = trot.state[:40].copy()
    state[:, :4] *= scale
    unit = unit_base(state)
    np.testing.assert_allclose(unit, trot.state[:40], rtol=0, atol=1e-14)
    assert unit_base(unit) is unit
    np.testing.assert_array_equal(unit[7], unit_base(state[7]))
    q, v = split(unit)
    assert q.shape == (40, 19)
    assert v.shape == (40, 18)
    turned = quat_multiply(q[:, :4], q[:, :4])
    np.testing.assert_allclose(np.linalg.det(quat_to_matrix(turned)), 1.0)


def test_a_monitor_still_ends_the_simulation(played, trot):
    """At the step at which it says so, not at the end of the control period."""
    simulator = MakeSimulator(played, PLAYED)
    StartEpisode(simulator, plan=trot)

    def monitor(context):
        if context.get_time() > 0.045:
            return EventStatus.ReachedTermination(played, "enough")
        return EventStatus.DidNothing()

    simulator.set_monitor(monitor)
    status = simulator.AdvanceTo(1.0)
    assert "enough" in status.FormatMessage()
    for time in (np.nan, 0.01):
        with pytest.raises(InputError, match=r"at 0.05 s already, and cannot"):
            simulator.AdvanceTo(time)
    assert simulator.get_context().get_time() == pytest.approx(0.05)


def test_set_domain_finds_the_robot_in_a_shared_plant(trot):
    """A body called base of somebody else's is not the trunk."""
    builder = DiagramBuilder()
    made = AddLocomotion(builder, PLAYED, pre_finalize=add_box)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    SetDomain(diagram, context, Domain(payload=2.5))
    plant_context = made.plant.GetMyContextFromRoot(context)
    mass = made.plant.CalcTotalMass(plant_context, [made.instance])
    assert mass == pytest.approx(made.robot.mass + 2.5)
    assert len(trot) * PLAN_DT > 1
