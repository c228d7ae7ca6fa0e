"""Point masses have the momentum of the robot's bodies, and forces explain errors."""

import numpy as np
import pytest
import torch

from loco_drake.common.gravity import GRAVITY
from loco_drake.common.rotations import rotate_plane, yaw_of
from loco_drake.generation import features as ft
from loco_drake.generation.point_masses import REGULARIZATION, PointMasses
from loco_drake.generation.tokenizer_score import Toes
from loco_drake.models.robots import get_robot
from loco_drake.motion import momentum
from loco_drake.motion.quality import toe_trajectories
from tests.robot_files import OWN

ROBOTS = ("go2", "a1")


def batch(robot, *motions):
    """Returns features in 64 bits, (B, T, SIZE)."""
    return torch.tensor(np.stack([ft.motion_features(robot, m) for m in motions]))


@pytest.mark.parametrize("definition", [*ROBOTS, str(OWN["anymal"])])
def test_the_points_move_like_the_bodies_of_drakes_model(make_synthetic, definition):
    """Also of ANYmal, whose rear knees point forward and whose zeros are offset."""
    robot = get_robot(definition)
    motion = make_synthetic("dog-trot", 2.0, 0.8, 0.3, name=robot.name)
    masses, index = PointMasses(("go2", robot.name)), torch.tensor([1])
    features = batch(robot, motion)
    found = masses.wrench(features, index)[0].numpy()
    model = momentum.mass_model(robot)
    q = momentum.positions(motion)
    wrench = momentum.wrench(model.momentum(q, motion.fps), model.mass, motion.fps)
    moment, force = wrench[:, :3], wrench[:, 3:] + model.mass * momentum.GRAVITY_W
    weight = model.mass * GRAVITY
    yaw = yaw_of(motion.base_quaternion)[1:-1]
    for column, expected in (
        (0, moment / (weight * robot.stand_height)),
        (3, force / weight),
    ):
        # Into the heading frame.
        expected[:, :2] = rotate_plane(expected[:, :2], -yaw)
        # The first frame of features has the velocity of the second.
        difference = found[1:, column : column + 3] - expected[1:]
        size = np.sqrt((expected**2).mean())
        assert size > 0.02
        assert np.sqrt((difference**2).mean()) < 0.03 * size


def test_what_remains_is_the_least_squares_over_forces(make_synthetic):
    """numpy's least squares, on the arms of numpy's kinematics and Drake's masses."""
    robot = get_robot("go2")
    target = make_synthetic("dog-trot", 1.0, 0.5)
    output = make_synthetic("dog-trot", 1.0, 0.7, phase=0.05)
    pair = batch(robot, output, target)
    masses, toes, index = PointMasses(ROBOTS), Toes(ROBOTS), torch.tensor([0])
    p_HF = toes.positions(pair[1:], index)
    found = masses.unexplained(pair[:1], pair[1:], p_HF, index)[0].numpy()
    error = (masses.wrench(pair[:1], index) - masses.wrench(pair[1:], index))[0].numpy()
    com = momentum.mass_model(robot).momentum(momentum.positions(target), 50.0).com
    soles = toe_trajectories(target, robot) - [0, 0, robot.foot_radius]
    arms = (soles - com[:, None]) / robot.stand_height
    for k, e in enumerate(error):
        feet = np.flatnonzero(target.contacts[k + 1])
        grasp = [
            np.vstack((np.cross(arms[k + 1, foot], np.eye(3)).T, np.eye(3)))
            for foot in feet
        ]
        columns = np.hstack(grasp)
        width = columns.shape[1]
        rows = np.vstack((columns, np.sqrt(REGULARIZATION) * np.eye(width)))
        wanted = np.concatenate((e, np.zeros(width)))
        force = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        least = ((rows @ force - wanted) ** 2).sum()
        assert found[k] == pytest.approx(least, rel=1e-3, abs=1e-9)


def test_nothing_explains_an_error_in_flight(make_synthetic):
    robot = get_robot("go2")
    pair = batch(
        robot, make_synthetic("dog-trot", 1.0, 0.5), make_synthetic("dog-pace", 1.0)
    )
    pair[..., ft.CONTACTS] = 0
    masses, toes, index = PointMasses(ROBOTS), Toes(ROBOTS), torch.tensor([0])
    found = masses.unexplained(
        pair[:1], pair[1:], toes.positions(pair[1:], index), index
    )
    error = masses.wrench(pair[:1], index) - masses.wrench(pair[1:], index)
    torch.testing.assert_close(found, error.square().sum(dim=-1))
    same = masses.unexplained(
        pair[1:], pair[1:], toes.positions(pair[1:], index), index
    )
    assert float(same.max()) == 0.0
