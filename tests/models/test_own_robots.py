"""Robots that are only a file and a URDF, as they are simulated: B1 and ANYmal.

Drake's plant of the maker's URDF says what is true.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.errors import InputError
from loco_drake.models.legs import MIRROR_JOINT_SIGNS, MIRROR_JOINTS, MIRROR_LEGS
from loco_drake.models.mjcf import robot_mjcf
from loco_drake.models.parameters import check_strength, least_strength
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robot_files import read_file
from loco_drake.models.robots import get_robot, known_robot, load_robot, robot_settings
from loco_drake.models.standing import stand
from loco_drake.models.urdf import find_urdf, read_xml, strip_urdf
from tests.robot_files import OWN, ROOT, SOLO8, made_up_urdf, write_made_up

NAMES = tuple(OWN)


def random_joints(robot, count=30):
    random = np.random.default_rng(0)
    return random.uniform(robot.joint_lower, robot.joint_upper, (count, 12))


@pytest.fixture(scope="module", params=NAMES)
def robot(request):
    return get_robot(str(OWN[request.param]))


@pytest.fixture(scope="module")
def chain(robot):
    """The same legs by products of exponentials, which tests compare with Drake."""
    return load_robot(robot.definition)


def test_closed_form_is_the_urdf_s_kinematics(robot, chain):
    joints = random_joints(robot)
    for name in ("toe_positions", "knee_positions", "toe_jacobians"):
        ours, theirs = (getattr(r, name)(joints) for r in (robot, chain))
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
    assert robot.stand_height == pytest.approx(chain.stand_height)
    assert (robot.name, robot.joint_names) == (chain.name, chain.joint_names)


def test_toes_are_put_where_they_are_asked_for(robot):
    """With the knees to the side of the stance, whatever the signs and zeros."""
    joints = random_joints(robot)
    joints[:, 0::3] *= 0.5  # the foot stays below the axis of the hip
    joints[:, 1::3] = robot.stand_joints[1::3] + 0.3 * (joints[:, 1::3] > 0)
    found = robot.leg_joints(robot.toe_positions(joints))
    np.testing.assert_allclose(found, joints, atol=1e-7)
    near = robot.nearest_joints(robot.toe_positions(robot.stand_joints))
    np.testing.assert_allclose(near, robot.stand_joints, atol=1e-9)


def test_backward_angles_are_those_of_a_leg_with_the_same_toe(robot):
    joints = random_joints(robot)
    angles = robot.backward_angles(joints)
    assert (angles[:, 2::3] <= 1e-9).all() or (robot.knee_signs < 0).all()
    turned = robot.joints_of_backward(angles)
    np.testing.assert_allclose(turned, joints, atol=1e-9)
    bare = replace(
        robot, joint_signs=np.ones(12), joint_zeros=np.zeros(12), knee_signs=-np.ones(4)
    )
    np.testing.assert_allclose(
        bare.toe_positions(angles), robot.toe_positions(joints), atol=1e-9
    )


def test_bodies_move_as_those_of_the_maker_s_urdf(robot):
    """Total mass, its centre and the joints' inertia, in any pose."""
    urdf = read_file(Path(robot.definition)).urdf
    root = read_xml(find_urdf(urdf, ROOT))
    text = strip_urdf(root, robot.joint_names, inertial=True)
    theirs, ours = MultibodyPlant(0.0), MultibodyPlant(0.0)
    Parser(theirs).AddModelsFromString(text, "urdf")
    robot.AddModel(Parser(ours))
    found = []
    for plant in (ours, theirs):
        plant.Finalize()
        context = plant.CreateDefaultContext()
        joints = [plant.GetJointByName(name) for name in robot.joint_names]
        trunk = plant.GetFrameByName(robot.trunk_frame)
        order = [joint.velocity_start() for joint in joints]
        for pose in random_joints(robot, 10):
            for joint, angle in zip(joints, pose, strict=True):
                joint.set_angle(context, angle)
            X_BW = trunk.CalcPoseInWorld(context).inverse()
            com = X_BW @ plant.CalcCenterOfMassPositionInWorld(context)
            M = plant.CalcMassMatrix(context)[np.ix_(order, order)]
            found.append((plant.CalcTotalMass(context), *com, *M.ravel()))
    ours, theirs = np.split(np.array(found), 2)
    rotors = np.diag(robot.reflected_inertia).ravel()
    np.testing.assert_allclose(ours - [0, 0, 0, 0, *rotors], theirs, atol=1e-5)
    assert robot.mass == pytest.approx(theirs[0, 0])


def test_gains_are_a_natural_frequency_and_a_damping(robot):
    rate = np.sqrt(robot.kp / robot.joint_inertia)
    np.testing.assert_allclose(rate, 2 * np.pi * 10)
    np.testing.assert_allclose(robot.kd, 2 * robot.joint_inertia * rate)
    # Left and right alike to the last bit, since policies are mirror-symmetric.
    np.testing.assert_array_equal(robot.kp, robot.kp[MIRROR_JOINTS])


def test_it_stands(robot):
    stood = stand(robot)
    assert stood.stands
    assert abs(stood.sunk) < 0.05 * robot.stand_height
    assert stood.tilt < 0.05


def test_weak_motors_are_bounded_as_go2_s(robot):
    least = least_strength(robot, PlantConfig())
    assert 0 <= least < 1
    check_strength(robot, PlantConfig(), least)
    assert -3.0 <= robot.least_payload < 0


def test_the_model_has_a_file_for_mujoco(robot):
    text = robot_mjcf(robot)
    assert all(f'joint="{name}"' in text for name in robot.joint_names)
    assert text.count('type="sphere"') == 8


def test_a_robot_that_was_read_is_known_by_its_name(robot):
    assert known_robot(robot.name) is robot
    assert known_robot("nobody") is None


def test_each_number_has_its_source():
    rows = {row.what: row for row in robot_settings(OWN["b1"])}
    assert rows["effort"] == ("effort", "91, 93.3, 140 N m", "URDF")
    assert "10 Hz" in rows["kp"].source
    assert rows["trunk's box"].source == "the robot's file"


def test_reversed_axes_are_the_same_robot(tmp_path):
    """All thighs and calves of B1 turned about -y: their joints change signs."""
    b1 = get_robot(str(OWN["b1"]))
    text = find_urdf(read_file(OWN["b1"]).urdf, ROOT).read_text()
    assert '<axis xyz="0 1 0"/>' in text
    text = text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 -1 0"/>')
    (tmp_path / "b1.urdf").write_text(text)
    legs = [
        f"  {leg}: {{joints: [{leg}_hip_joint, {leg}_thigh_joint, {leg}_calf_joint], "
        f"foot: {leg}_foot, stand: [0, -0.75, 1.5], lower: [-0.75, -3.5, 0.6], "
        "upper: [0.75, 1, 2.6]}"
        for leg in ("FL", "FR", "RL", "RR")
    ]
    head = "urdf: b1.urdf\ntrunk: trunk\nfoot_radius: 0.04\nlegs:\n"
    (tmp_path / "reversed.yaml").write_text(head + "\n".join(legs) + "\n")
    turned = get_robot(str(tmp_path / "reversed.yaml"))
    signs = np.tile([1.0, -1.0, -1.0], 4)
    np.testing.assert_array_equal(turned.joint_signs, signs)
    joints = random_joints(b1)
    toes = b1.toe_positions(joints)
    np.testing.assert_allclose(turned.toe_positions(signs * joints), toes, atol=1e-12)
    np.testing.assert_allclose(
        turned.nearest_joints(toes), signs * b1.nearest_joints(toes), atol=1e-9
    )
    np.testing.assert_allclose(
        turned.backward_angles(signs * joints), b1.backward_angles(joints), atol=1e-12
    )
    J, other = b1.toe_jacobians(joints), turned.toe_jacobians(signs * joints)
    np.testing.assert_allclose(other, J * [1.0, -1.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(turned.kp, b1.kp, rtol=1e-9)
    assert turned.folded_length == pytest.approx(b1.folded_length)
    mirrored = joints[:, MIRROR_JOINTS] * MIRROR_JOINT_SIGNS
    np.testing.assert_allclose(
        turned.toe_positions(signs * mirrored),
        turned.toe_positions(signs * joints)[:, MIRROR_LEGS] * [1, -1, 1],
        atol=1e-9,
    )


def spoiled(tmp_path, name, *changes):
    text = OWN[name].read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "spoiled.yaml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([("trunk_size", "box")], "simulation has the unknown field 'box'"),
        ([("trunk_size: [0.647, 0.3, 0.15]", "effort: [1, 2]")], "three numbers above"),
        ([("trunk_size: [0.647, 0.3, 0.15]", "kp: [1, 2, 3]")], "need each other"),
        (
            [("trunk_size: [0.647, 0.3, 0.15]", "gear_ratio: [1, 2, 3]")],
            "needs simulation.rotor_inertia",
        ),
        (
            [("trunk_size: [0.647, 0.3, 0.15]", "effort: [9, 9, 9]")],
            "times its torque limit",
        ),
        (
            [("trunk_size: [0.647, 0.3, 0.15]", "effort: [900, 9000, 900]")],
            "which is no limit; give simulation.effort",
        ),
        (
            [("trunk_size: [0.647, 0.3, 0.15]", "natural_frequency: 99")],
            "natural_frequency must be a number from 1 to 30",
        ),
        ([("[0, 0.75, -1.5]", "[0.1, 0.75, -1.5]")], "joints of the stance are off"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_one_sentence(
    tmp_path, changes, message
):
    with pytest.raises(InputError, match=message):
        get_robot(spoiled(tmp_path, "b1", *changes))


def test_eight_joints_are_for_retargeting_only():
    with pytest.raises(InputError, match=r"three joints in each leg.* not 2; retarg"):
        get_robot(str(SOLO8))


def test_links_without_mass_are_for_retargeting_only(tmp_path):
    path = write_made_up(tmp_path / "light.yaml", made_up_urdf())
    assert load_robot(str(path)).name == "light"
    with pytest.raises(InputError, match="every link needs a mass, but body has 0 kg"):
        get_robot(str(path))


def test_legs_that_turn_about_other_axes_are_for_retargeting_only(tmp_path):
    urdf = made_up_urdf().replace('xyz="1 0 0"', 'xyz="0 0 1"')
    path = write_made_up(tmp_path / "crab.yaml", urdf)
    with pytest.raises(InputError, match="hip must turn about x, forward, but"):
        get_robot(str(path))


def test_sides_that_turn_about_opposite_axes_are_named(tmp_path):
    """The hip of FR alone is reversed."""
    lines = made_up_urdf().splitlines()
    text = "\n".join(
        line.replace('xyz="1 0 0"', 'xyz="-1 0 0"') if "FR_hip_joint" in line else line
        for line in lines
    )
    path = write_made_up(tmp_path / "odd.yaml", text)
    with pytest.raises(InputError, match="FL_hip_joint and FR_hip_joint turn about op"):
        get_robot(str(path))
