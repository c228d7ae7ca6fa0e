"""Legs of any URDF against Drake's own kinematics, and inverse against forward."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.models.robots import get_robot, load_robot
from tests.robot_files import FOREIGN, SOLO8, write_robot


@pytest.fixture(scope="module", params=["solo8", *FOREIGN])
def robot(request, tmp_path_factory):
    if request.param == "solo8":
        return load_robot(str(SOLO8))
    folder = tmp_path_factory.mktemp("robots")
    return load_robot(str(write_robot(folder / "robot.yaml", request.param)))


def poses(robot, count=20, spread=0.3):
    """Joints around the stance, within the limits."""
    offsets = np.random.default_rng(0).normal(size=(count, len(robot.joint_names)))
    joints = robot.stand_joints + spread * offsets
    return np.clip(joints, robot.joint_lower + 0.01, robot.joint_upper - 0.01)


def plant_points(robot, joints, frames):
    """Origins of frames in B by Drake, shape (T, len(frames), 3)."""
    plant = MultibodyPlant(0.0)
    robot.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    base = plant.GetFrameByName(robot.trunk_frame)
    points = []
    for angles in joints:
        for name, angle in zip(robot.joint_names, angles, strict=True):
            plant.GetJointByName(name).set_angle(context, angle)
        points.append(
            [frame(plant).CalcPose(context, base).translation() for frame in frames]
        )
    return np.array(points)


def test_toes_and_knees_are_where_drake_has_them(robot):
    joints = poses(robot)
    feet = [lambda plant, f=f: plant.GetFrameByName(f) for f in robot.foot_frames]
    expected = plant_points(robot, joints, feet)
    np.testing.assert_allclose(robot.toe_positions(joints), expected, atol=1e-12)
    count = len(robot.joint_names) // 4
    last = robot.joint_names[count - 1 :: count]
    knees = [lambda plant, j=j: plant.GetJointByName(j).frame_on_child() for j in last]
    expected = plant_points(robot, joints, knees)
    np.testing.assert_allclose(robot.knee_positions(joints), expected, atol=1e-12)


def test_inverse_finds_the_toes_and_keeps_within_the_limits(robot):
    p_BF = robot.toe_positions(poses(robot, spread=0.2))
    joints = robot.nearest_joints(p_BF)
    np.testing.assert_allclose(robot.toe_positions(joints), p_BF, atol=1e-8)
    assert (joints >= robot.joint_lower).all()
    assert (joints <= robot.joint_upper).all()


def test_toe_far_below_is_met_by_a_leg_that_points_at_it(robot):
    """No joint can bring it nearer."""
    p_BF = robot.toe_positions(robot.stand_joints)[None].copy()
    p_BF[:, 1, 2] -= 1.0
    joints = robot.nearest_joints(p_BF)
    toes = robot.toe_positions(joints)
    np.testing.assert_allclose(toes[:, [0, 2, 3]], p_BF[:, [0, 2, 3]], atol=1e-8)
    distance = np.linalg.norm(p_BF - toes, axis=-1)[0, 1]
    for k in range(len(robot.joint_names)):
        for step in (-1e-3, 1e-3):
            other = joints[0].copy()
            other[k] += step
            if robot.joint_lower[k] <= other[k] <= robot.joint_upper[k]:
                moved = robot.toe_positions(other)[1]
                assert np.linalg.norm(p_BF[0, 1] - moved) >= distance - 1e-9


def test_solo8_by_hand():
    """Hips .19 m ahead; twice .16 m; thigh .8 rad, calf back; feet .15005 to the side.

    Folded to 2.8 rad the toe is 2 * .16 * cos(1.4) below the hip, and .04545 beside it.
    """
    robot = load_robot(str(SOLO8))
    height = 0.32 * np.cos(0.8)
    assert robot.stand_height == pytest.approx(height + 0.016)
    toes = robot.toe_positions(robot.stand_joints)
    sides = 0.15005 * np.array([1, -1, 1, -1])
    np.testing.assert_allclose(toes[:, 1], sides)
    np.testing.assert_allclose(toes[:, 2], -height)
    np.testing.assert_allclose(toes[:, 0], [0.19, 0.19, -0.19, -0.19], atol=1e-12)
    p_BV = np.stack(([0.19, 0.19, -0.19, -0.19], sides, np.zeros(4)), axis=-1)
    np.testing.assert_allclose(robot.p_BV, p_BV, atol=1e-12)
    folded = np.hypot(0.32 * np.cos(1.4), 0.04545)
    assert robot.folded_length == pytest.approx(folded, rel=1e-4)
    knees = robot.knee_positions(robot.stand_joints)
    ahead = 0.16 * np.sin(0.8)
    expected = [0.19 - ahead, 0.19 - ahead, ahead - 0.19, ahead - 0.19]
    np.testing.assert_allclose(knees[:, 0], expected)


def test_planar_leg_leaves_its_toe_beside_a_target_to_the_side():
    """3 cm further out is out of reach: the nearest is straight beside it."""
    robot = load_robot(str(SOLO8))
    p_BF = robot.toe_positions(robot.stand_joints)
    aside = p_BF + np.array([0.0, 0.03, 0.0])
    np.testing.assert_allclose(robot.reachable_toes(aside), p_BF, atol=1e-8)


def test_go2_as_a_file_is_the_go2(tmp_path):
    """Chains of its URDF agree with the closed forms, in both directions."""
    go2, chain = (
        get_robot("go2"),
        load_robot(str(write_robot(tmp_path / "b.yaml", "go2"))),
    )
    assert chain.joint_names == go2.joint_names
    joints = poses(go2)
    toes = go2.toe_positions(joints)
    np.testing.assert_allclose(chain.toe_positions(joints), toes, atol=1e-12)
    np.testing.assert_allclose(chain.nearest_joints(toes), joints, atol=1e-6)
    for name in ("p_BHip", "p_BV", "joint_lower", "joint_upper", "joint_speed_limits"):
        np.testing.assert_allclose(getattr(chain, name), getattr(go2, name), atol=1e-12)
    assert chain.stand_height == pytest.approx(go2.stand_height)
    # The chains' is to the toe; the closed form's leaves the abduction offset out.
    assert chain.folded_length == pytest.approx(go2.folded_length, rel=1e-3)
    knees = go2.knee_positions(joints)
    np.testing.assert_allclose(chain.knee_positions(joints), knees, atol=1e-12)
    np.testing.assert_allclose(
        chain.toe_jacobians(joints), go2.toe_jacobians(joints), atol=1e-12
    )
