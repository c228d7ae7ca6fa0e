"""A humanoid's file, and its kinematics against the manufacturer's URDF."""

import re

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.errors import InputError
from loco_drake.models import biped_file
from loco_drake.models.biped_file import is_biped_file, read_biped
from loco_drake.models.robots import load_figure
from loco_drake.models.urdf import find_urdf

FILE = biped_file.Path(biped_file.__file__).parent / "g1" / "g1.yaml"


@pytest.fixture(scope="module")
def g1():
    return read_biped("g1")


@pytest.fixture(scope="module")
def plant():
    """The URDF with all its joints, without what is to be seen."""
    text = find_urdf(
        re.search("urdf: (.*)", FILE.read_text())[1], FILE.parent
    ).read_text()
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", text, flags=re.DOTALL)
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("pelvis"))
    plant.Finalize()
    return plant


def test_it_has_the_joints_and_limits_of_the_urdf(g1, plant):
    assert len(g1.joint_names) == plant.num_positions() == 29
    joints = [plant.GetJointByName(name) for name in g1.joint_names]
    for what, values in (
        ("position_lower_limits", g1.joint_lower),
        ("position_upper_limits", g1.joint_upper),
        ("velocity_upper_limits", g1.joint_speed_limits),
    ):
        expected = [getattr(joint, what)()[0] for joint in joints]
        np.testing.assert_allclose(values, expected)
    sides = [g1.side(k) for k in range(29)]
    assert sides == [n.split("_")[0].replace("waist", "middle") for n in g1.joint_names]


def test_soles_are_where_the_urdf_has_its_spheres(g1, plant):
    """x, y and z of the collision spheres of each foot, in any pose."""
    random = np.random.default_rng(0)
    joints = random.uniform(g1.joint_lower, g1.joint_upper)
    context = plant.CreateDefaultContext()
    for name, angle in zip(g1.joint_names, joints, strict=True):
        plant.GetJointByName(name).set_angle(context, angle)
    centres = {
        "toes": [[0.12, 0.025, -0.03], [0.12, -0.025, -0.03]],
        "heels": [[-0.05, 0.025, -0.03], [-0.05, -0.025, -0.03]],
    }
    expected = [
        plant.GetFrameByName(f"{side}_ankle_roll_link").CalcPoseInWorld(context) @ p
        for ends in centres.values()
        for side in ("left", "right")
        for p in np.array(ends)
    ]
    np.testing.assert_allclose(g1.toe_positions(joints), expected, atol=1e-9)
    ends = np.reshape(expected, (4, 2, 3)).mean(axis=1)
    np.testing.assert_allclose(g1.sole_ends(joints), ends, atol=1e-9)
    both = g1.toe_positions(np.stack((joints, g1.stand_joints)))
    np.testing.assert_allclose(both[0], expected, atol=1e-9)


def test_in_the_stance_soles_are_level_under_the_hips(g1):
    soles = g1.toe_positions(g1.stand_joints)
    np.testing.assert_allclose(soles[:, 2], g1.foot_radius - g1.stand_height, atol=1e-9)
    assert 0.7 < g1.stand_height < 0.8
    assert g1.hip_height == pytest.approx(g1.stand_height - 0.1027)
    middle = soles.reshape(2, 2, 2, 3).mean(axis=(0, 2))
    np.testing.assert_allclose(g1.p_BV[:, :2], middle[:, :2], atol=1e-9)
    # A straight leg is a little longer than that of the stance, to the ankle.
    assert 1 < g1.leg_reach / (g1.hip_height + g1.heel[2] - g1.foot_radius) < 1.03


def test_legs_move_without_arms_and_arms_without_legs(g1):
    for add, count in ((g1.AddLegs, 12), (g1.AddUpperBody, 17), (g1.AddModel, 29)):
        plant = MultibodyPlant(time_step=0.0)
        add(Parser(plant))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("pelvis"))
        plant.Finalize()
        assert plant.num_positions() == count


def test_it_is_told_from_robots_on_four_legs(g1):
    assert load_figure("g1") is g1
    assert load_figure("go2").name == "go2"
    assert not is_biped_file("go2")
    assert not is_biped_file("examples/b1.yaml")
    assert is_biped_file(str(FILE))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("chest: torso_link", "", "It lacks chest."),
        ("trunk: pelvis", "trunk: hip", "Unknown link 'hip'"),
        ("left_knee_joint", "left_ankle_roll_joint", "is named twice"),
        ("left_knee_joint", "left_toe_joint", "Unknown joint 'left_toe_joint'"),
        ("stand: [-0.2, 0, 0, 0.4", "stand: [-0.2, 0, 0", "must be 6 numbers"),
        ("[-0.2, 0, 0, 0.4", "[-0.2, 0, 0, 4", "is not within"),
        ("[-0.2, 0, 0, 0.4, -0.2", "[-0.2, 0, 0, 0.4, 0.3", "soles must be level"),
        ("radius: 0.005", "radius: 0", "a radius above 0"),
        ("toe: [0.12, 0, -0.03]", "toe: [0.12, 0]", "heel and toe, three numbers"),
        ("arms:", "wings:", "wings"),
        (
            "  right: {joints: [right_hip",
            "  wrong: {joints: [right_hip",
            "must be left",
        ),
        ("g1_29dof_rev_1_0.urdf", "g2.urdf", "There is no URDF"),
    ],
)
def test_files_that_cannot_be_are_refused_by_name(tmp_path, old, new, reason):
    text = FILE.read_text()
    assert old in text
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=re.escape(reason)) as refused:
        read_biped(str(path))
    assert str(path) in str(refused.value)


def test_no_such_humanoid():
    with pytest.raises(InputError, match="Unknown humanoid 'go2'; the choices are g1"):
        read_biped("go2")
