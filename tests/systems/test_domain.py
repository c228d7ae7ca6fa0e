"""Each part of a domain against what physics says."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.errors import InputError
from loco_drake.control.domain import Domain, Push, SensorErrors
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.terrain import Terrain, slope_gradient, toes_in_world
from loco_drake.models.plant import (
    CONTACTS,
    ConfigureSimulator,
    PlantConfig,
    plant_damping,
)
from loco_drake.models.robots import AddRobotModel, get_robot
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.domain import FollowTerrain, SetDomain
from loco_drake.systems.scenario import (
    Disturbances,
    ExternalAction,
    LoadScenario,
    PlanReference,
    Scenario,
)
from loco_drake.systems.simulator import MakeSimulator, StartEpisode

ALL = Disturbances(actuation=True, pushes=True, sensors=True, terrain=True)
GRAVITY = 9.81
GO2_MASS, GO2_TRUNK = 16.085, 7.277  # kg, as in its URDF
FAR_UP = 50.0  # m


def incline(degrees, direction):
    return Terrain(gradient=slope_gradient(degrees, direction))


class Standing:
    """A robot that is to stand still, in a domain; ``action`` moves its set-points."""

    def __init__(self, robot, domain, plant=None, height=0.0):
        plant = plant or PlantConfig()
        diagram = MakeLocomotionDiagram(
            Scenario(
                robot=robot.name,
                plant=plant,
                reference=PlanReference(),
                smoother=None,
                policy=ExternalAction(),
                disturbances=ALL,
            )
        )
        self.diagram = diagram
        self.simulator = Simulator(diagram)
        ConfigureSimulator(self.simulator, plant)
        self.context = self.simulator.get_mutable_context()
        self.plant = diagram.GetSubsystemByName("plant")
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        action = diagram.GetInputPort("action").FixValue(self.context, np.zeros(12))
        self._action = action.GetMutableData().get_mutable_value()
        SetDomain(diagram, self.context, domain)
        q = self.plant.GetPositions(self.plant_context).copy()
        q[6] += height
        self.plant.SetPositions(self.plant_context, q)
        self.simulator.Initialize()

    def act(self, value):
        self._action.set_value(np.full(12, value))

    def advance(self, time):
        self.simulator.AdvanceTo(time)
        return self.state

    @property
    def state(self):
        return self.plant.GetPositionsAndVelocities(self.plant_context).copy()

    def slide(self, speed):
        """Gives all of the robot a speed along x."""
        v = self.plant.GetVelocities(self.plant_context).copy()
        v[3] += speed
        self.plant.SetVelocities(self.plant_context, v)

    @property
    def momentum(self):
        return self.plant.CalcSpatialMomentumInWorldAboutPoint(
            self.plant_context, np.zeros(3)
        ).translational()

    @property
    def contacts(self):
        """Forces on the robot (N, 3), their points in the world, and depths (N,)."""
        results = self.plant.get_contact_results_output_port().Eval(self.plant_context)
        infos = [
            results.point_pair_contact_info(i)
            for i in range(results.num_point_pair_contacts())
        ]
        ground = self.plant.world_body().index()
        forces = [
            info.contact_force() * (1 if info.bodyA_index() == ground else -1)
            for info in infos
        ]
        depths = [info.point_pair().depth for info in infos]
        points = [info.contact_point() for info in infos]
        return np.array(forces).reshape(-1, 3), np.array(points), np.array(depths)


@pytest.mark.parametrize("contact", CONTACTS)
def test_sliding_feet_are_held_back_by_coulombs_friction(go2, contact):
    """Ground of .1 under feet of .8: the harmonic mean is 2 (.08) / .9 = .178."""
    robot = Standing(go2, Domain(friction=0.1), PlantConfig(contact=contact))
    robot.advance(0.3)
    robot.slide(0.5)
    impulse = np.zeros(3)
    for k in range(31, 41):
        robot.advance(k * 0.01)
        impulse += robot.contacts[0].sum(axis=0)
    assert impulse[2] > 0.08 * GO2_MASS * GRAVITY / 0.01
    assert -impulse[0] / impulse[2] == pytest.approx(0.16 / 0.9, rel=0.03)


def test_a_payload_weighs_on_the_feet(go2):
    robot = Standing(go2, Domain(payload=3.0))
    robot.advance(4.0)
    total = robot.contacts[0][:, 2].sum()
    assert total == pytest.approx((GO2_MASS + 3.0) * GRAVITY, rel=1e-4)


def test_a_shifted_trunk_shifts_the_centre_of_pressure(go2):
    """By 7.277 kg of 16.085 kg times 3 cm, as seen from the trunk, which sways."""

    def centre(shift):
        robot = Standing(go2, Domain(com_shift=shift))
        robot.advance(2.0)
        forces, points, _ = robot.contacts
        return forces[:, 2] @ points[:, :2] / forces[:, 2].sum() - robot.state[4:6]

    moved = centre(np.array([0.03, -0.02, 0.0])) - centre(np.zeros(3))
    expected = np.array([0.03, -0.02]) * GO2_TRUNK / GO2_MASS
    np.testing.assert_allclose(moved, expected, rtol=0.02)


def test_soft_ground_is_a_spring_in_series_with_the_feet(go2):
    """Two of 5e4 N/m give 2.5e4."""
    robot = Standing(go2, Domain(stiffness=5e4))
    robot.advance(2.0)
    forces, _, depths = robot.contacts
    np.testing.assert_allclose(forces[:, 2] / depths, 2.5e4, rtol=0.01)


@pytest.mark.parametrize("contact", ["similar", "cenic"])
def test_a_push_changes_the_momentum_by_force_times_duration(go2, contact):
    """In the air, where nothing else acts along x and y."""
    pushes = (
        Push(start=0.1, duration=0.1, force_W=np.array([40.0, -20.0, 0.0])),
        Push(start=0.16, duration=0.1, force_W=np.array([0.0, 10.0, 0.0])),
    )
    plant = PlantConfig(contact=contact)
    robot = Standing(go2, Domain(pushes=pushes), plant, height=FAR_UP)
    robot.advance(0.1)
    np.testing.assert_allclose(robot.momentum[:2], 0.0, atol=0.01)
    robot.advance(0.14)
    np.testing.assert_allclose(robot.momentum[:2], [1.6, -0.8], atol=0.01)
    robot.advance(0.3)
    np.testing.assert_allclose(robot.momentum[:2], [4.0, -1.0], atol=0.01)


@pytest.mark.parametrize("contact", ["similar", "lagged", "sap"])
def test_late_motors_answer_late_by_exactly_so_many_steps(go2, contact):
    """20 ms late, and told one control period earlier: the same, to the last bit."""

    def run(latency, sample):
        robot = Standing(go2, Domain(latency=latency), PlantConfig(contact=contact))
        states = []
        for k in range(15):
            robot.act(0.5 if k >= sample else 0.0)
            states.append(robot.advance((k + 1) * PLAN_DT))
        return np.array(states)

    np.testing.assert_array_equal(run(0.02, 5), run(0.0, 6))
    assert (run(0.02, 6) != run(0.0, 6)).any()


@pytest.mark.parametrize("contact", ["similar", "cenic"])
@pytest.mark.parametrize("steps", [0, 1, 3])
def test_a_step_of_the_action_moves_the_joints_that_many_steps_later(
    go2, contact, steps
):
    plant = PlantConfig(contact=contact, time_step=0.005)
    domain = Domain(latency=steps * plant.time_step)
    told, other = (Standing(go2, domain, plant, height=FAR_UP) for _ in range(2))
    for robot in (told, other):
        robot.advance(0.1)
    told.act(1.0)
    moved = []
    for k in range(1, 7):
        time = (20 + k) * plant.time_step
        change = told.advance(time) - other.advance(time)
        moved.append(bool(np.abs(change).max() > 0.01))
    assert moved == [k > steps for k in range(1, 7)]


def test_weak_motors_hold_with_their_share_of_the_torque(go2):
    """Standing at .8, from the actuators themselves."""
    robot = Standing(go2, Domain(strength=np.full(12, 0.8)))
    robot.advance(3.0)
    targets = robot.diagram.GetSubsystemByName("joint_targets")
    q_d = targets.GetOutputPort("desired_state").Eval(
        targets.GetMyContextFromRoot(robot.context)
    )[:12]
    q, v = robot.state[7:19], robot.state[25:]
    asked = go2.kp * (q_d - q) - plant_damping(go2, PlantConfig()) * v
    given = robot.diagram.GetOutputPort("net_actuation").Eval(robot.context)
    assert np.abs(asked).max() > 3.0
    np.testing.assert_allclose(given, 0.8 * asked, atol=0.02)


@pytest.mark.parametrize("strength", [0.8, 1.2])
@pytest.mark.parametrize("contact", ["similar", "lagged", "sap"])
def test_joints_move_as_with_gains_that_much_lower(go2, contact, strength):
    """In the air, against a plant whose gains were scaled before it was finalized."""
    plant = PlantConfig(contact=contact)
    domain = Domain(strength=np.full(12, strength))
    robot = Standing(go2, domain, plant, height=FAR_UP)
    ours = []
    for k in range(25):
        robot.act(np.sin(0.7 * k))
        ours.append(robot.advance((k + 1) * PLAN_DT))
    theirs = _with_scaled_gains(go2, contact, strength)
    nominal = _with_scaled_gains(go2, contact, 1.0)
    np.testing.assert_allclose(ours, theirs, atol=1e-6)
    assert np.abs(theirs - nominal).max() > 0.1


@pytest.mark.parametrize("contact", ["similar", "lagged", "sap"])
def test_joints_move_as_with_motors_that_damp_that_much_more_or_less(go2, contact):
    """In the air, against a plant built with .9 of kp and .9 d of kd.

    The plant's own damping is what the step's h kp leaves of that.
    """
    for damping in (0.9, 1.3):
        domain = Domain(strength=np.full(12, 0.9), damping=damping)
        robot = Standing(go2, domain, PlantConfig(contact=contact), height=FAR_UP)
        ours = []
        for k in range(25):
            robot.act(np.sin(0.7 * k))
            ours.append(robot.advance((k + 1) * PLAN_DT))
        theirs = _with_scaled_gains(go2, contact, 0.9, damping)
        np.testing.assert_allclose(ours, theirs, atol=1e-6)
        assert np.abs(theirs - _with_scaled_gains(go2, contact, 0.9)).max() > 0.05


def test_joint_friction_opposes_a_joint_that_turns_and_none_that_stands(go2):
    """.3 N m, from the change of the set-point times kp, at 2 rad/s and at rest."""
    with_friction, without = (
        Standing(go2, Domain(joint_friction=friction), height=FAR_UP)
        for friction in (0.3, 0.0)
    )
    asked = []
    for robot in (with_friction, without):
        v = np.zeros(18)
        v[6:] = [2.0, -2.0, 0.0] * 4
        robot.plant.SetVelocities(robot.plant_context, v)
        port = robot.diagram.GetOutputPort("desired_state")
        asked.append(go2.kp * port.Eval(robot.context)[:12])
    torque = asked[0] - asked[1]
    np.testing.assert_allclose(torque, [-0.3, 0.3, 0.0] * 4, atol=1e-9)


def test_joints_with_the_largest_friction_come_to_rest(go2):
    """The torque is explicit: a step that is too long for it would chatter."""
    weak = Domain(joint_friction=0.5, damping=0.8)
    for height in (0.0, FAR_UP):
        robot = Standing(go2, weak, height=height)
        robot.act(0.5)
        robot.advance(2.0)
        speeds = [robot.advance(2.0 + 0.01 * k)[25:] for k in range(1, 20)]
        assert np.abs(speeds).max() < 5e-3


@pytest.mark.parametrize("contact", ["similar", "cenic"])
def test_a_robot_slides_down_a_steep_slope_as_physics_says(go2, contact):
    """20 degrees with .178: g (sin - .178 cos) along the slope, here along -x."""
    terrain = incline(20.0, 0.0)
    plant = PlantConfig(contact=contact)
    robot = Standing(go2, Domain(friction=0.1, terrain=terrain), plant)
    place(robot, terrain)
    robot.advance(0.2)
    start = robot.momentum / GO2_MASS
    robot.advance(0.6)
    change = (robot.momentum / GO2_MASS - start) / 0.4
    angle = np.deg2rad(20.0)
    size = GRAVITY * (np.sin(angle) - 0.16 / 0.9 * np.cos(angle))
    down = -np.array([np.cos(angle), 0.0, np.sin(angle)])
    np.testing.assert_allclose(change, size * down, atol=0.03 * size)


def test_a_robot_stands_on_a_slope_and_its_height_is_that_over_the_ground(go2):
    terrain = incline(8.0, 0.7)
    robot = Standing(go2, Domain(terrain=terrain))
    place(robot, terrain, at=(3.0, -1.0))
    robot.advance(1.0)
    forces = robot.contacts[0]
    np.testing.assert_allclose(forces.sum(axis=0)[2], GO2_MASS * GRAVITY, rtol=0.02)
    rise = np.tan(np.deg2rad(8.0)) * np.array([np.cos(0.7), np.sin(0.7)])
    x, y, z = robot.state[4:7]
    height = robot.diagram.GetOutputPort("state").Eval(robot.context)[6]
    assert height == pytest.approx(z - rise @ [x, y])
    assert height == pytest.approx(go2.stand_height, abs=0.02)
    assert z > 0.5


def test_feet_rest_on_the_bumps_under_them(go2):
    """The lowest points of the toe spheres, from the joints, against the surface."""
    terrain = Terrain(gradient=np.array([0.05, 0.0]), roughness=0.04, seed=3)
    robot = Standing(go2, Domain(terrain=terrain))
    place(robot, terrain, at=(2.0, 1.0))
    for k in range(1, 101):
        FollowTerrain(robot.diagram, robot.context)
        robot.advance(k * PLAN_DT)
    assert len(robot.contacts[0]) == 4
    toes = toes_in_world(go2, robot.state[:19])
    heights, gradients = terrain.surface(toes[:, :2])
    assert np.ptp(heights - toes[:, 0] * 0.05) > 0.01
    cosines = 1 / np.sqrt(1 + (gradients**2).sum(axis=1))
    gaps = (toes[:, 2] - heights) * cosines - go2.foot_radius
    np.testing.assert_allclose(gaps, 0.0, atol=0.003)


def test_a_step_carries_whoever_stands_on_it(go2):
    """Beyond the edge at 1 m the ground is 5 cm higher, and so is the base."""
    terrain = Terrain(gradient=np.zeros(2), step=0.05)
    for x, raised in ((0.5, 0.0), (2.0, 0.05)):
        robot = Standing(go2, Domain(terrain=terrain))
        place(robot, terrain, at=(x, 0.0))
        robot.advance(1.0)
        height = robot.diagram.GetOutputPort("state").Eval(robot.context)[6]
        assert robot.state[6] - raised == pytest.approx(height)
        assert height == pytest.approx(go2.stand_height, abs=0.02)
        forces, points, _ = robot.contacts
        assert forces[:, 2].sum() == pytest.approx(GO2_MASS * GRAVITY, rel=0.02)
        np.testing.assert_allclose(points[:, 2], raised, atol=2e-3)


def test_a_simulator_moves_the_ground_at_every_control_period(go2):
    """Bit for bit as with one call a period, however AdvanceTo is called."""
    scenario = Scenario(
        reference=PlanReference(),
        smoother=None,
        policy=ExternalAction(),
        disturbances=Disturbances(terrain=True),
    )
    diagram = MakeLocomotionDiagram(scenario)
    domain = Domain(terrain=Terrain(gradient=np.zeros(2), roughness=0.04, seed=1))
    ends = []
    for times in ([0.5], [0.013, 0.2, 0.47, 0.5], np.arange(1, 26) * PLAN_DT):
        simulator = MakeSimulator(diagram, scenario)
        context = simulator.get_mutable_context()
        diagram.GetInputPort("action").FixValue(context, np.full(12, 0.5))
        StartEpisode(simulator, domain=domain)
        for time in times:
            simulator.AdvanceTo(time)
        ends.append(diagram.GetOutputPort("state").Eval(context).copy())
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


def place(robot, terrain, at=(0.0, 0.0)):
    """Puts a standing robot on the slope."""
    state = robot.state
    state[4:6] = at
    state = terrain.in_world(terrain.placed(get_robot("go2"), state))
    robot.plant.SetPositionsAndVelocities(robot.plant_context, state)
    FollowTerrain(robot.diagram, robot.context)


def _with_scaled_gains(go2, contact, strength, damping=1.0):
    """States (25, 37) of a robot in the air, sent the set-points of the test above."""
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=0.01,
        discrete_contact_approximation=contact,
        use_sampled_output_ports=False,
    )
    plant, _ = AddMultibodyPlant(config, builder)
    instance = AddRobotModel(Parser(plant), go2.name, visual=False)
    for index in plant.GetJointActuatorIndices():
        gains = plant.get_joint_actuator(index).get_controller_gains()
        # The step damps by the rest.
        d = damping * gains.d - 0.01 * gains.p
        plant.get_joint_actuator(index).set_controller_gains(
            PdControllerGains(p=strength * gains.p, d=strength * d)
        )
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    q = [1, 0, 0, 0, 0, 0, go2.stand_height + FAR_UP, *go2.stand_joints]
    plant.SetPositions(context, q)
    port = plant.get_desired_state_input_port(instance).FixValue(context, np.zeros(24))
    targets = _standing_set_points(go2)
    states = []
    for k in range(25):
        desired = targets + 0.15 * np.sin(0.7 * k)
        port.GetMutableData().get_mutable_value().set_value([*desired, *np.zeros(12)])
        simulator.AdvanceTo((k + 1) * PLAN_DT)
        states.append(plant.GetPositionsAndVelocities(context).copy())
    return np.array(states)


def _standing_set_points(go2):
    robot = Standing(go2, Domain(), height=FAR_UP)
    robot.advance(0.01)
    return robot.diagram.GetOutputPort("desired_state").Eval(robot.context)[:12]


def test_a_domain_like_the_model_changes_nothing(go2):
    """The systems are there and do nothing: the same states, to the last bit."""
    plain = MakeLocomotionDiagram(
        Scenario(reference=PlanReference(), smoother=None, policy=ExternalAction())
    )
    for name in ("actuation", "pushes", "sensors"):
        assert not plain.HasSubsystemNamed(name)
    simulator = Simulator(plain)
    context = simulator.get_mutable_context()
    plain.GetInputPort("action").FixValue(context, np.full(12, 0.5))
    simulator.AdvanceTo(0.5)
    robot = Standing(go2, Domain())
    robot.act(0.5)
    robot.advance(0.5)
    for name in ("state", "observation", "net_actuation"):
        np.testing.assert_array_equal(
            plain.GetOutputPort(name).Eval(context),
            robot.diagram.GetOutputPort(name).Eval(robot.context),
        )


@pytest.mark.parametrize(
    ("name", "domain"),
    [
        ("actuation", Domain(latency=0.02)),
        ("actuation", Domain(strength=np.ones(12))),
        ("actuation", Domain(damping=1.1)),
        ("actuation", Domain(joint_friction=0.1)),
        ("terrain", Domain(terrain=incline(5.0, 0.0))),
        ("pushes", Domain(pushes=(Push(start=0, duration=1, force_W=np.ones(3)),))),
        (
            "sensors",
            Domain(sensors=SensorErrors(bias=np.ones(36), white=np.ones(36), seed=0)),
        ),
    ],
)
def test_a_diagram_without_the_system_is_refused(name, domain):
    text = "disturbances: {actuation: true, pushes: true, sensors: true, terrain: true}"
    scenario = LoadScenario(
        data="{reference: !PlanReference {}, policy: !ExternalAction {}}", overlay=text
    )
    diagram = MakeLocomotionDiagram(scenario)
    SetDomain(diagram, diagram.CreateDefaultContext(), domain)
    setattr(scenario.disturbances, name, False)
    lacking = MakeLocomotionDiagram(scenario)
    with pytest.raises(InputError, match=rf"Disturbances\({name}=True\)"):
        SetDomain(lacking, lacking.CreateDefaultContext(), domain)


def test_all_of_it_is_in_the_context(go2):
    """A clone goes on as the original does, and the defaults bring the model back."""
    domain = Domain(
        friction=0.5,
        stiffness=1e5,
        payload=2.0,
        com_shift=np.array([0.02, 0.0, 0.0]),
        strength=np.linspace(0.9, 1.1, 12),
        damping=1.1,
        joint_friction=0.2,
        terrain=Terrain(gradient=slope_gradient(4.0, 2.0), roughness=0.01, step=0.02),
        latency=0.02,
        pushes=(Push(start=0.2, duration=0.1, force_W=np.array([60.0, 0, 0])),),
    )
    robot = Standing(go2, domain)
    robot.act(0.5)
    robot.advance(0.13)
    clone = Simulator(robot.diagram, robot.context.Clone())
    clone.AdvanceTo(0.5)
    robot.advance(0.5)
    port = robot.diagram.GetOutputPort("state")
    first = port.Eval(robot.context).copy()
    np.testing.assert_array_equal(first, port.Eval(clone.get_context()))

    robot.diagram.SetDefaultContext(robot.context)
    robot.context.SetTime(0.0)
    robot.simulator.Initialize()
    like_the_model = Standing(go2, Domain())
    like_the_model.act(0.5)
    np.testing.assert_array_equal(robot.advance(0.5), like_the_model.advance(0.5))
    assert (robot.state != first).any()
