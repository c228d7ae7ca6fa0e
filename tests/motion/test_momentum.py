"""Momentum against Drake's simulation and against bodies that are known by hand."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.momentum import (
    free_fall_error,
    halfway,
    mass_model,
    missing_wrench,
    momentum_error,
    positions,
)
from loco_drake.motion.motion import FPS, make_motion

G = 9.81


@pytest.fixture(scope="module", params=["go2", "a1"])
def robot(request):
    return get_robot(request.param)


def rigid_motion(robot, height, contacts, turn=None):
    """The standing pose, with the trunk at these heights over its own, (T,), in m."""
    frames = len(height)
    position = np.zeros((frames, 3))
    position[:, 2] = robot.stand_height + height
    level = np.tile([1.0, 0, 0, 0], (frames, 1))
    return make_motion(
        robot=robot.name,
        label=GaitLabel("dog", "trot"),
        joint_names=robot.joint_names,
        base_position=position,
        base_quaternion=level if turn is None else turn,
        joint_positions=np.tile(robot.stand_joints, (frames, 1)),
        contacts=np.broadcast_to(np.array(contacts), (frames, 4)).copy(),
        provenance={},
    )


def thrown(robot, gravity=G):
    """Half a second of flight under this gravity."""
    time = np.arange(26) / FPS
    return rigid_motion(robot, gravity * time * (0.5 - time) / 2, [False] * 4)


def test_body_in_free_fall_has_no_error(robot):
    assert free_fall_error(thrown(robot), robot) == pytest.approx(0, abs=1e-6)
    assert momentum_error(thrown(robot), robot) == pytest.approx(0, abs=1e-6)


def test_flight_played_at_half_speed_misses_three_quarters_of_gravity(robot):
    """Accelerations are a quarter: .75 g of 9.81 m/s^2, and .75 of the weight."""
    slow = thrown(robot, G / 4)
    assert free_fall_error(slow, robot) == pytest.approx(0.75 * G)
    assert momentum_error(slow, robot) == pytest.approx(0.75)


def test_standing_robot_is_carried_by_its_feet_and_by_nothing_else(robot):
    """On four feet 0; on none its weight is missing; a motion without flight has none.

    On its left feet alone the weight would act at half the track's width from them.
    """
    still = np.zeros(10)
    stands = rigid_motion(robot, still, [True] * 4)
    assert momentum_error(stands, robot) == pytest.approx(0, abs=1e-9)
    assert free_fall_error(stands, robot) is None
    floats = rigid_motion(robot, still, [False] * 4)
    assert momentum_error(floats, robot) == pytest.approx(1)
    assert free_fall_error(floats, robot) == pytest.approx(G)
    leaning = rigid_motion(robot, still, [True, False, True, False])
    # Up and to the side, in weights and standing heights: least squares by hand.
    com = mass_model(robot).momentum(positions(leaning), FPS).com[0]
    aside = robot.toe_positions(robot.stand_joints)[[0, 2], 1].mean() - com[1]
    arm = np.array([aside, -com[2]]) / robot.stand_height
    effect = np.array([[1, 0], [0, 1], [arm[0], -arm[1]]])
    _, (square,), *_ = np.linalg.lstsq(effect, np.array([1.0, 0, 0]))
    assert momentum_error(leaning, robot) == pytest.approx(np.sqrt(square), rel=1e-3)
    assert momentum_error(leaning, robot) > 0.3


def test_feet_do_not_pull(robot):
    """Falling at 2 g on standing feet takes a pull of the robot's weight."""
    time = np.arange(10) / FPS
    pulled = rigid_motion(robot, -G * time**2, [True] * 4)
    assert momentum_error(pulled, robot) == pytest.approx(1, rel=1e-6)


def test_friction_is_limited(robot):
    """Speeding up at 2 g sideways takes two weights; friction gives about .8."""
    motion = rigid_motion(robot, np.zeros(10), [True] * 4)
    position = motion.base_position.copy()
    position[:, 1] = G * (np.arange(10) / FPS) ** 2
    sideways = replace(motion, base_position=position)
    assert momentum_error(sideways, robot) > 0.5


def test_spin_that_grows_in_flight_is_seen(robot):
    """A pitch that speeds up at 100 rad/s^2 in free fall has a moment of I 100 Nm."""
    time = np.arange(26) / FPS
    pitch = 50 * time**2 / 2
    zero = np.zeros_like(pitch)
    half = np.stack((np.cos(pitch / 2), zero, np.sin(pitch / 2), zero), axis=1)
    # About the centre of mass, not the trunk's origin.
    motion = rigid_motion(robot, G * time * (0.5 - time) / 2, [False] * 4, half)
    com = mass_model(robot).momentum(positions(motion), FPS).com
    fall = np.stack((zero, zero, G * time * (0.5 - time) / 2), axis=1)
    motion = replace(motion, base_position=motion.base_position - com + fall)
    remains = missing_wrench(motion, robot)
    np.testing.assert_allclose(remains[:, 3:], 0, atol=1e-6)
    moments = remains[:, 1] * robot.mass * G * robot.stand_height
    inertia = moments / 50
    assert inertia.std() < 1e-3 * inertia.mean()
    assert 0.1 < inertia.mean() < 1.0  # kg m^2, of a robot of 12 to 15 kg


def test_derivatives_of_the_centre_of_mass_are_drakes_momentum(robot):
    """Central differences along random velocities against the momentum by mass."""
    model, random = mass_model(robot), np.random.default_rng(0)
    q = positions(rigid_motion(robot, np.zeros(3), [True] * 4))
    q[:, 7:] += 0.2 * random.standard_normal(q[:, 7:].shape)
    v = random.standard_normal((3, 18))
    v[:, :3] = 0  # the trunk's orientation is tested by the spin
    matrices = model.momentum_matrices(q, v[..., None])
    step = 1e-6
    ahead, behind = (q + np.pad(s * v[:, 3:], ((0, 0), (4, 0))) for s in (step, -step))
    rate = (model.momentum(ahead, 1.0).com - model.momentum(behind, 1.0).com) / 2 / step
    np.testing.assert_allclose(rate, matrices[:, 3:, 0] / model.mass, atol=1e-7)


def test_robot_that_drake_simulates_in_the_air_obeys_physics(robot):
    """Motors swing its legs while it tumbles; 50 frames/s see it to a hundredth."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
    robot.AddModel(Parser(plant))
    plant.Finalize()
    torques = np.tile([0.3, -0.8, 0.5], 4) * np.repeat([1, -1, -1, 1], 3)
    source = builder.AddSystem(ConstantVectorSource(torques))
    builder.Connect(source.get_output_port(), plant.get_actuation_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    start = positions(rigid_motion(robot, np.full(3, 1.0), [False] * 4))[0]
    plant.SetPositions(context, start)
    plant.SetVelocities(context, [0.5, 1.0, 0.3, 1.0, 0.2, 1.0, *[0.0] * 12])
    rows = []
    for k in range(13):
        simulator.AdvanceTo(k / FPS)
        rows.append(plant.GetPositions(context).copy())
    q = np.array(rows)
    motion = make_motion(
        robot=robot.name,
        label=GaitLabel("dog", "trot"),
        joint_names=robot.joint_names,
        base_position=q[:, 4:7],
        base_quaternion=q[:, :4] / np.linalg.norm(q[:, :4], axis=1, keepdims=True),
        joint_positions=q[:, 7:],
        contacts=np.zeros((13, 4), dtype=bool),
        provenance={},
    )
    assert np.abs(np.diff(q[:, 7:], axis=0)).max() * FPS > 3  # rad/s
    assert free_fall_error(motion, robot) < 0.02
    assert momentum_error(motion, robot) < 0.01
    # The same flight with legs that do not move is one of another body.
    stiff = replace(motion, joint_positions=np.repeat(q[:1, 7:], 13, axis=0))
    assert free_fall_error(stiff, robot) > 0.5


def test_halfway_by_hand():
    """A quarter turn about z in one step of a second, and a step of 2 m."""
    q = np.zeros((2, 8))
    q[0, 0], q[1, 0], q[1, 3] = 1, np.sqrt(0.5), np.sqrt(0.5)
    q[1, 4] = 2.0
    middle, v = halfway(q, 1.0)
    eighth = [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8), 1, 0, 0, 0]
    np.testing.assert_allclose(middle, [eighth], atol=1e-12)
    np.testing.assert_allclose(v, [[0, 0, np.pi / 2, 2, 0, 0, 0]], atol=1e-12)
