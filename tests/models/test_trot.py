import numpy as np
import pytest

from loco_drake.models.robots import ROBOTS, get_robot
from tests.models.trot import trot_joints


@pytest.mark.parametrize("name", ROBOTS)
def test_trot_is_periodic_and_diagonal(name):
    """After the ramp each leg repeats every .5 s, its diagonal twin moves with it."""
    robot = get_robot(name)
    times = np.arange(0.0, 3.0, 0.02)
    joints = trot_joints(robot, times)
    np.testing.assert_allclose(joints[50:100], joints[75:125], atol=1e-12)
    x = (robot.toe_positions(joints) - robot.toe_positions(robot.stand_joints))[..., 0]
    assert np.corrcoef(x[50:, 0], x[50:, 3])[0, 1] > 0.9
    assert np.corrcoef(x[50:, 0], x[50:, 1])[0, 1] < -0.5


def test_targets_lead_by_the_weight():
    """At the start FR and RL carry all: m g / 2 on arms known from the stance.

    16.085 kg x 9.81 / 2 = 78.9 N a leg; over kp = 100 Nm/rad that is .0753 rad on the
    hip (arm .0955 m), none on the thigh (toe below), .1263 on the calf (.213 sin .85).
    """
    robot = get_robot("go2")
    times = np.linspace(0.0, 3.0, 151)
    joints = trot_joints(robot, times, speed=0.0, lift=0.0)
    lead = (joints[0] - robot.stand_joints).reshape(4, 3)
    np.testing.assert_allclose(lead[1], [0.0753, 0.0, 0.1263], atol=1e-4)
    np.testing.assert_allclose(lead[2], [-0.0753, 0.0, 0.1263], atol=1e-4)
    np.testing.assert_allclose(lead[[0, 3]], 0.0, atol=1e-12)


def test_trot_is_within_limits():
    robot = get_robot("go2")
    joints = trot_joints(robot, np.linspace(0.0, 3.0, 151))
    assert np.all(joints > robot.joint_lower)
    assert np.all(joints < robot.joint_upper)
