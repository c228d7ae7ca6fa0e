import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

from loco_drake.models.legs import (
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_LEGS,
    MIRROR_POLAR,
)
from loco_drake.models.robots import ROBOTS, AddRobotModel, get_robot

LEGS = ("FL", "FR", "RL", "RR")


@pytest.fixture(params=ROBOTS)
def robot(request):
    return get_robot(request.param)


@pytest.fixture
def joints(robot):
    rng = np.random.default_rng(0)
    return rng.uniform(robot.joint_lower, robot.joint_upper, (40, 12))


@pytest.fixture
def plant(robot):
    plant = MultibodyPlant(0.0)
    AddRobotModel(Parser(plant), robot.name, visual=False)
    plant.Finalize()
    return plant


def test_toe_positions_are_the_plants(robot, joints, plant):
    context = plant.CreateDefaultContext()
    base = plant.GetFrameByName("base")
    for row, p_BF in zip(joints, robot.toe_positions(joints), strict=True):
        plant.SetPositions(context, [1, 0, 0, 0, 0, 0, 0, *row])
        for leg, p in zip(LEGS, p_BF, strict=True):
            X_BF = plant.GetFrameByName(f"{leg}_foot").CalcPose(context, base)
            np.testing.assert_allclose(p, X_BF.translation(), atol=1e-12)


def test_toe_jacobians_are_the_plants(robot, joints, plant):
    context = plant.CreateDefaultContext()
    base = plant.GetFrameByName("base")
    for row, J in zip(joints, robot.toe_jacobians(joints), strict=True):
        plant.SetPositions(context, [1, 0, 0, 0, 0, 0, 0, *row])
        for k, leg in enumerate(LEGS):
            expected = plant.CalcJacobianTranslationalVelocity(
                context,
                JacobianWrtVariable.kV,
                plant.GetFrameByName(f"{leg}_foot"),
                np.zeros(3),
                base,
                base,
            )
            own = slice(6 + 3 * k, 9 + 3 * k)
            np.testing.assert_allclose(J[k], expected[:, own], atol=1e-12)


def test_toe_jacobians_are_the_derivative_of_toe_positions(robot, joints):
    """Central differences of 1e-6 rad, of which the error is about 1e-10 m/rad."""
    J = robot.toe_jacobians(joints)
    for k in range(3):
        step = np.zeros(12)
        step[k::3] = 1e-6
        difference = robot.toe_positions(joints + step) - robot.toe_positions(
            joints - step
        )
        np.testing.assert_allclose(J[..., k], difference / 2e-6, atol=1e-8)


def test_leg_joints_invert_toe_positions(robot):
    """Any joints whose toes are below the hip's axis, in the leg's plane, come back."""
    rng = np.random.default_rng(1)
    lower = np.maximum(robot.joint_lower, np.tile([-1.0, -0.4, -3], 4))
    upper = np.minimum(robot.joint_upper, np.tile([1.0, 1.5, 0], 4))
    joints = rng.uniform(lower, upper, (500, 12))
    below = robot.thigh_length * np.cos(joints[:, 1::3]) + robot.calf_length * np.cos(
        joints[:, 1::3] + joints[:, 2::3]
    )
    joints = joints[(below > 0.02).all(axis=1)]
    assert len(joints) > 200
    np.testing.assert_allclose(
        robot.leg_joints(robot.toe_positions(joints)), joints, atol=1e-9
    )


@pytest.mark.parametrize(
    ("scale", "limit"), [(3.0, "joint_upper"), (0.2, "joint_lower")]
)
def test_out_of_reach_leg_points_at_the_target(robot, scale, limit):
    """Too far or too near: the calf is at its limit and the toe on the target's ray."""
    stance = robot.toe_positions(robot.stand_joints)
    thigh = robot.p_BHip + robot.abduction_offset[:, None] * [0, 1, 0]
    target = thigh + scale * (stance - thigh)
    joints = robot.leg_joints(target)
    np.testing.assert_array_equal(joints[2::3], getattr(robot, limit)[2::3])
    ray = robot.toe_positions(joints) - thigh
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    np.testing.assert_allclose(ray, np.tile([0, 0, -1], (4, 1)), atol=1e-12)


def test_target_inside_the_hips_reach_is_finite(robot):
    """Nearer to the hip's axis than the thigh's offset no leg can get: no NaN."""
    assert np.isfinite(robot.leg_joints(robot.p_BHip + 1e-3)).all()


def test_mirrored_joints_have_mirrored_toes(robot, joints):
    mirrored = joints[:, MIRROR_JOINTS] * MIRROR_JOINT_SIGNS
    np.testing.assert_allclose(
        robot.toe_positions(mirrored),
        robot.toe_positions(joints)[:, MIRROR_LEGS] * MIRROR_POLAR,
        atol=1e-15,
    )


def test_leading_shapes(robot, joints):
    """One frame, a row of frames and a block of frames give the same numbers."""
    block = joints.reshape(5, 8, 12)
    p_BF = robot.toe_positions(block)
    assert p_BF.shape == (5, 8, 4, 3)
    assert robot.toe_jacobians(block).shape == (5, 8, 4, 3, 3)
    assert robot.leg_joints(p_BF).shape == (5, 8, 12)
    np.testing.assert_array_equal(robot.toe_positions(joints[9]), p_BF[1, 1])
    np.testing.assert_array_equal(
        robot.leg_joints(p_BF[1, 1]), robot.leg_joints(p_BF)[1, 1]
    )
