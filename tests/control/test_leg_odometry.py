"""What a leg on the ground says of the base is so."""

import numpy as np
import pytest
import torch

from loco_drake.common.rotations import heading_matrix, quat_to_matrix
from loco_drake.control.leg_odometry import LegOdometry
from loco_drake.models.robots import get_robot
from tests.robot_files import OWN


@pytest.mark.parametrize("name", ["go2", "a1", str(OWN["anymal"])])
def test_legs_that_stand_still_tell_velocity_and_height(name):
    """A base moves for a microsecond; by its joints each toe stays where it is."""
    robot, random = get_robot(name), np.random.default_rng(0)
    q_WB = random.standard_normal(4) * [1, 0.2, 0.2, 1]
    R_WB = quat_to_matrix(q_WB / np.linalg.norm(q_WB))
    R_WH = heading_matrix(R_WB)
    joints = 0.2 * random.standard_normal(12)
    v_WB, w_B = random.standard_normal(3), random.standard_normal(3)
    p_BF = robot.toe_positions(robot.stand_joints + joints)
    # v_WF = v_WB + R_WB (w x p + J qdot) = 0
    J = robot.toe_jacobians(robot.stand_joints + joints)
    wanted = -(v_WB @ R_WB + np.cross(w_B, p_BF))
    speeds = np.linalg.solve(J, wanted[..., None])[..., 0].reshape(12)
    inputs = (-R_WB[2], w_B, joints, speeds)
    velocity, height = LegOdometry(robot)(
        *(torch.tensor(x, dtype=torch.float32) for x in inputs)
    )
    np.testing.assert_allclose(velocity, [v_WB @ R_WH] * 4, atol=1e-5)
    np.testing.assert_allclose(height, -(p_BF @ R_WB.T)[:, 2], atol=1e-6)
