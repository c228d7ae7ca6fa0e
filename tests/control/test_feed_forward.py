"""Set-points and torques of plans, against forward dynamics by Drake."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.control.action import set_points
from loco_drake.control.feed_forward import (
    FRICTION,
    MAX_LOAD,
    feed_forward_torques,
    stance_forces,
)
from loco_drake.control.plan import PLAN_DT, make_plan, standing_plan
from loco_drake.models.plant import AddRobotPlant, PlantConfig

IN_THE_AIR = 50.0  # m


class Flight:
    """A robot that falls from great height, in steps of a millisecond."""

    def __init__(self, robot):
        builder = DiagramBuilder()
        config = PlantConfig(time_step=1e-3)
        self.plant, _, self.instance = AddRobotPlant(builder, robot, config)
        # Limp without set-points.
        self.forces = self.plant.get_applied_generalized_force_input_port()
        self.targets = self.plant.get_desired_state_input_port(self.instance)
        diagram = builder.Build()
        self.simulator = Simulator(diagram)
        root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(root)
        q = self.plant.GetPositions(self.context).copy()
        q[6] = IN_THE_AIR
        self.plant.SetPositions(self.context, q)

    def advance(self):
        """One control period on; returns q and v."""
        time = self.simulator.get_context().get_time()
        self.simulator.AdvanceTo(time + PLAN_DT)
        return np.split(self.plant.GetPositionsAndVelocities(self.context), [19])


def torques_at(k):
    """Joint torques in the period that ends at sample k, smooth in time, Nm."""
    return 0.6 * np.sin(2 * np.pi * 4 * k * PLAN_DT + np.arange(12))


@pytest.fixture(scope="module")
def flight_plan(go2):
    """What a falling robot does under known torques, as a plan without contacts."""
    flight = Flight(go2)
    q, v = [flight.plant.GetPositions(flight.context).copy()], [np.zeros(18)]
    for k in range(1, 20):
        applied = np.append(np.zeros(6), torques_at(k))
        flight.forces.FixValue(flight.context, applied)
        for states, state in zip((q, v), flight.advance(), strict=True):
            states.append(state.copy())
    q = np.array(q)
    q[:, :4] /= np.linalg.norm(q[:, :4], axis=1, keepdims=True)
    return make_plan(
        go2,
        q=q,
        v=np.array(v),
        contacts=np.zeros((len(q), 4), dtype=bool),
        labels=np.zeros(len(q), dtype=np.int64),
    )


def test_the_torques_of_a_flight_are_those_that_made_it(go2, flight_plan):
    torques = feed_forward_torques(go2, flight_plan)[1:]
    applied = np.array([torques_at(k) for k in range(1, 20)])
    np.testing.assert_allclose(torques, applied, atol=0.1)


def test_set_points_alone_repeat_a_flight(go2, flight_plan):
    """The PD follows joints that turn by half a radian."""
    flight = Flight(go2)
    flight.plant.SetPositions(flight.context, flight_plan.q[0])
    joints = []
    for target in set_points(go2, flight_plan)[1:]:
        flight.targets.FixValue(flight.context, np.append(target, np.zeros(12)))
        joints.append(flight.advance()[0][7:])
    moved = np.ptp(flight_plan.q[:, 7:], axis=0)
    assert moved.max() > 0.4
    np.testing.assert_allclose(joints, flight_plan.q[1:, 7:], atol=0.01)


def test_standing_feet_carry_the_weight_where_it_is(go2):
    """Forces on front and rear feet hold the centre of mass, wherever it is."""
    plan = standing_plan(go2)
    torques = feed_forward_torques(go2, plan)[0]
    flight = Flight(go2)
    flight.plant.SetPositions(flight.context, plan.q[0])
    p_WC = flight.plant.CalcCenterOfMassPositionInWorld(flight.context)
    front, rear = plan.p_WF[0, 0, 0], plan.p_WF[0, 2, 0]
    share = (p_WC[0] - rear) / (front - rear) / 2  # of the weight, on a front foot
    forces = go2.mass * 9.81 * np.array([share, share, 0.5 - share, 0.5 - share])
    J = go2.toe_jacobians(plan.q[0, 7:])
    expected = -forces[:, None] * J[:, 2]
    # The legs' own weight hangs on their joints.
    own = flight.plant.CalcGravityGeneralizedForces(flight.context)[6:]
    np.testing.assert_allclose(torques + own, expected.ravel(), atol=0.3)
    alike = -go2.mass * 9.81 / 4 * J[:, 2]
    assert (
        np.abs(expected.ravel() - (torques + own)).max()
        < 0.5 * np.abs(alike.ravel() - (torques + own)).max()
    )


def test_stance_forces_are_the_least_squares_solution(go2):
    """Of one stacked problem by NumPy; feet in the air get none."""
    random = np.random.default_rng(0)
    p = go2.toe_positions(go2.stand_joints + 0.2 * random.normal(size=(5, 12)))
    needed = random.normal(size=(5, 6)) * [5, 5, 5, 20, 20, 20] + [0, 0, 0, 0, 0, 150]
    contacts = random.random((5, 4)) < 0.6
    f = stance_forces(needed, p, contacts, needed[:, 5])
    for i in range(5):
        feet = np.flatnonzero(contacts[i])
        moments = [np.cross(p[i, k], np.eye(3)).T for k in feet]
        A = np.vstack((5 * np.hstack(moments), np.tile(np.eye(3), len(feet))))
        f0 = np.tile([0, 0, needed[i, 5] / len(feet)], len(feet))
        rows = np.vstack((A, 0.1**0.5 * np.eye(3 * len(feet))))
        wanted = np.concatenate((5 * needed[i, :3], needed[i, 3:], 0.1**0.5 * f0))
        expected = np.zeros((4, 3))
        expected[feet] = np.linalg.lstsq(rows, wanted)[0].reshape(-1, 3)
        np.testing.assert_allclose(f[i], expected, atol=1e-9)


def test_feet_neither_pull_nor_slide_nor_carry_the_impossible(go2):
    """Pushed and pulled as no ground can, the joints get bounded torques."""
    rest = standing_plan(go2)
    v = np.zeros((21, 18))
    v[:, 3] = 40 * PLAN_DT * np.arange(21)  # 40 m/s^2 forward: beyond friction
    v[10:, 5] = np.linspace(0, 30, 11)  # 150 m/s^2 up
    plan = make_plan(
        go2,
        q=np.repeat(rest.q, 21, axis=0),
        v=v,
        contacts=np.ones((21, 4), dtype=bool),
        labels=np.zeros(21, dtype=np.int64),
    )
    # What the legs themselves take is far below what the forces take.
    most = MAX_LOAD * go2.mass * 9.81 * np.hypot(1, FRICTION) * 0.43
    assert np.abs(feed_forward_torques(go2, plan)[2:]).max() < most
