"""URDFs as people have them: what is above the trunk, turned, misnamed, no URDF."""

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from loco_drake.models.robots import load_robot
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.retarget import retarget_clip
from tests.robot_files import made_up_urdf, write_made_up
from tests.synthetic import write_dog_recording

WORLD = '<link name="world"/>'


def above(parent, kind):
    """Links and a joint that ties the trunk to ``parent``."""
    return (
        f'<joint name="base" type="{kind}"><parent link="{parent}"/>'
        '<child link="body"/><origin xyz="0 0 0.4"/></joint>'
    )


TOPS = {
    "world_floating": WORLD + above("world", "floating"),
    "world_fixed": WORLD + above("world", "fixed"),
    "root_floating": '<link name="root"/>' + above("root", "floating"),
    "world_and_more": WORLD
    + '<link name="root"/><joint name="w" type="fixed"><parent link="world"/>'
    + '<child link="root"/></joint>'
    + above("root", "floating"),
    "planar": WORLD + above("world", "planar"),
}


def load(tmp_path, urdf, **changes):
    return load_robot(str(write_made_up(tmp_path / "made_up.yaml", urdf, **changes)))


@pytest.fixture
def plain(tmp_path):
    return load(tmp_path, made_up_urdf())


@pytest.fixture
def dog_clip(tmp_path):
    write_dog_recording(tmp_path / "dog.txt", "trot", seconds=1.0)
    return read_clip("dog", tmp_path / "dog.txt", gait="trot")


def test_made_up_robot_by_hand(plain):
    """Twice .22 m at .8 rad, and .02 m of foot; feet .15 m to the sides."""
    height = 0.44 * np.cos(0.8)
    assert plain.stand_height == pytest.approx(height + 0.02)
    toes = plain.toe_positions(plain.stand_joints)
    expected = [[0.2, 0.15], [0.2, -0.15], [-0.2, 0.15], [-0.2, -0.15]]
    np.testing.assert_allclose(toes[:, :2], expected, atol=1e-12)


@pytest.mark.parametrize("name", TOPS)
def test_what_is_above_the_trunk_does_not_matter(tmp_path, plain, name):
    """Kinematics and solved joints are those of the file that begins at the trunk."""
    robot = load(tmp_path, made_up_urdf(TOPS[name]))
    joints = plain.stand_joints + 0.1 * np.sin(np.arange(48.0)).reshape(4, 12)
    p_BF = plain.toe_positions(joints)
    np.testing.assert_allclose(robot.toe_positions(joints), p_BF, atol=1e-12)
    assert robot.stand_height == pytest.approx(plain.stand_height)
    found, expected = (LegSolver(r, FPS).solve(p_BF).joints for r in (robot, plain))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_clip_becomes_the_same_motion_under_a_floating_joint(tmp_path, plain, dog_clip):
    robot = load(tmp_path, made_up_urdf(TOPS["world_floating"]))
    motion, report = retarget_clip(dog_clip, robot)
    expected, _ = retarget_clip(dog_clip, plain)
    np.testing.assert_allclose(
        motion.joint_positions, expected.joint_positions, atol=1e-6
    )
    assert report.toe_error_rmse_m < 1e-4


def test_missing_meshes_and_inertias_are_not_missed(tmp_path, plain):
    """Only links and joints are read."""
    visual = (
        '<link name="core"><inertial><mass value="0"/></inertial><visual><geometry>'
        '<mesh filename="package://nowhere/core.dae"/></geometry></visual></link>'
    )
    urdf = made_up_urdf().replace('<link name="core"/>', visual)
    robot = load(tmp_path, urdf)
    np.testing.assert_array_equal(robot.axes, plain.axes)


@pytest.mark.parametrize(
    ("turn", "forward", "left", "up"),
    [
        ("0 0 3.14159265", "-x", "-y", r"\+z"),
        ("3.14159265 0 0", r"\+x", "-y", "-z"),
        ("0 0 1.57079633", r"\+y", "-x", r"\+z"),
        ("1.57079633 0 0", r"\+x", r"\+z", "-y"),  # of a file with y down
        ("-1.57079633 0 0", r"\+x", "-z", r"\+y"),  # y up
        ("0 -1.57079633 0", r"\+z", r"\+y", "-x"),
    ],
)
def test_turned_trunk_is_refused_with_the_frame_that_mends_it(
    tmp_path, plain, turn, forward, left, up
):
    """The frame that the message proposes, put into the URDF, makes the file right."""
    urdf = made_up_urdf(turn=turn)
    with pytest.raises(
        InputError, match=f"forward is {forward}, left {left} and up {up}"
    ) as caught:
        load(tmp_path, urdf)
    message = str(caught.value)
    frame = message[message.index("<frame") : message.index("/>") + 2]
    robot = load(tmp_path, urdf.replace("</robot>", f"{frame}</robot>"), trunk="trunk")
    joints = plain.stand_joints
    np.testing.assert_allclose(
        robot.toe_positions(joints), plain.toe_positions(joints), atol=1e-4
    )


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        (("FR", "FL", "RR", "RL"), "FL is front right, FR is front left, RL is rear r"),
        (("RL", "RR", "FL", "FR"), "FL is rear left, FR is rear right, RL is front l"),
        (("RR", "FR", "RL", "FL"), "FL is rear right, RR is front left"),
        (("FR", "FL", "RL", "RR"), "FL is front right, FR is front left"),
        (("RL", "FR", "FL", "RR"), "FL is rear left, RL is front left"),
    ],
)
def test_legs_that_are_not_where_their_names_say_are_named(tmp_path, names, reason):
    with pytest.raises(InputError, match=reason):
        load(tmp_path, made_up_urdf(), names=names)


def test_all_legs_misnamed_or_a_trunk_turned_round_is_either(tmp_path):
    """Front left called rear right, and so on: turning the trunk would mend it too."""
    with pytest.raises(
        InputError, match=r"forward is -x, left -y .* or correct the names"
    ):
        load(tmp_path, made_up_urdf(), names=("RR", "RL", "FR", "FL"))


def spoil(old, new):
    urdf = made_up_urdf()
    assert old in urdf
    return urdf.replace(old, new)


CALF = '<link name="FL_calf"/><joint name="FL_calf_joint" type="revolute">'


@pytest.mark.parametrize(
    ("urdf", "reason"),
    [
        (made_up_urdf(unit=1000.0), r"would be 307 m .* in millimetres\?"),
        (spoil(CALF, CALF + '<mimic joint="FR_calf_joint"/>'), "FL_calf_joint, on the"),
        (
            spoil(CALF, CALF.replace("revolute", "prismatic")),
            "Joint FL_calf_joint is prismatic; only revolute",
        ),
        (
            spoil(CALF, CALF.replace("revolute", "floating")),
            "Joint FL_calf_joint is floating; only revolute",
        ),
        (spoil("0 0.05 0", "0 nan 0"), "Drake cannot read"),
        (spoil("0 0.05 0", "0 1e300 0"), "joints more than 100000 m away"),
        (spoil('<axis xyz="1 0 0"/>', '<axis xyz="0 0 0"/>'), "Drake cannot read"),
        (spoil("0 0.05 0", "0 one 0"), "Drake cannot read"),
        (spoil("0 0.05 0", "0 ${hip} 0"), "a xacro file, not URDF yet: expand it with"),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>',
            "a xacro file",
        ),
        ('<sdf version="1.9"><model name="a"/></sdf>', "is an SDF file; only URDF"),
        ('<mujoco model="a"><worldbody/></mujoco>', "an MJCF file of MuJoCo; only URD"),
        (
            spoil('<child link="FL_foot"/>', '<child link="FR_foot"/>'),
            "Drake cannot read",
        ),
        (
            spoil('upper="1"', 'upper="-2"'),
            "FL_hip_joint contradict each other: lower -1",
        ),
        (
            spoil('upper="1"', 'upper="one"'),
            "limits of joint FL_hip_joint are not numb",
        ),
        (spoil('velocity="20"', 'velocity="-1"'), "contradict each other"),
        (spoil('velocity="20"', 'velocity="nan"'), "contradict each other"),
        (spoil('velocity="20"', 'velocity="0"'), "move at 0 rad/s; give its leg's spe"),
        ("<html/>", "is XML whose root is 'html', not 'robot'; only URDF is read"),
        ("<robot/>", "Unknown joint 'FL_hip_joint'"),
        ("no XML", "is not XML"),
        ("", "is not XML"),
    ],
)
def test_urdf_that_is_none_or_of_no_such_robot_is_refused(tmp_path, urdf, reason):
    with pytest.raises(InputError, match=reason) as caught:
        load(tmp_path, urdf)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 700


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        (
            {"foot": "{}_calf"},
            "FL_calf is not the end of its leg: link FL_foot reaches",
        ),
        ({"stand": "[0, 46, -92]"}, r"stand of leg FL must be in rad.*in degrees\?"),
        ({"foot_radius": "20"}, r"foot_radius must be in m.*in millimetres\?"),
        ({"trunk": "core_joint"}, "Unknown trunk 'core_joint'; the choices are body"),
        ({"trunk": "FL_foot"}, "is moved by|not below the trunk|must lie"),
    ],
)
def test_fields_that_the_urdf_contradicts(tmp_path, fields, reason):
    with pytest.raises(InputError, match=reason):
        load(tmp_path, made_up_urdf(), **fields)


def test_links_at_the_foot_are_no_longer_leg(tmp_path, plain):
    """A sensor 5 mm below the foot's centre leaves it the end of the leg."""
    sensor = (
        '<link name="s"/><joint name="s_joint" type="fixed"><parent link="FL_foot"/>'
        '<child link="s"/><origin xyz="0 0 -0.005"/></joint></robot>'
    )
    robot = load(tmp_path, made_up_urdf().replace("</robot>", sensor))
    np.testing.assert_array_equal(robot.toes, plain.toes)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{urdf: [", "is not a robot file: while parsing"),
        ("- 1", "it must be a mapping of foot_radius, legs, name, simulation,"),
        ("urfd: x", "unknown field 'urfd'; there are foot_radius, legs, name, simul"),
        (
            "legs: {FL: {feet: a}}",
            "legs.FL has the unknown field 'feet'; there are foo",
        ),
        ("legs: 3", "legs must be a mapping by name, not 3"),
        (
            "legs: {FL: 3}",
            "legs.FL must be a mapping of foot, joints, lower, speed, st",
        ),
        ("legs: {FL: {joints: hip}}", "legs.FL.joints must be a list, not 'hip'"),
        ("legs: {FL: {stand: [a]}}", "an item of legs.FL.stand must be a number, not"),
        ("legs: {FL: {joints: [1]}}", "an item of legs.FL.joints must be text, not 1"),
        ("foot_radius: true", "foot_radius must be a number, not True"),
        ("5: a", "every key must be text"),
        ("urdf: 5", "urdf must be text, not 5"),
        ("trunk: ", "trunk must be text, not None"),
        ("urdf: a\ntrunk: b\nurdf: c", "line 3 names 'urdf' a second time"),
        ("legs: {FL: {foot: a, foot: b}}", "line 1 names 'foot' a second time"),
        ("name: [{a: 1}, {a: 1, a: 2}]", "line 1 names 'a' a second time"),
        ("legs: " + "[" * 20_000, "nested too deeply"),
        ("# " + "x" * 200_000, "more than 100 kB"),
        ("urdf: \0", "special characters are not allowed"),
        ("urdf: " + "u" * 5000, "It lacks"),
        (
            "\n".join(
                [
                    "a0: &a0 [1, 1]",
                    *(f"a{k}: &a{k} [{f'*a{k - 1}, ' * 9}]" for k in range(1, 30)),
                ]
            ),
            "unknown field 'a0'",
        ),
        ("", "It lacks urdf, trunk, legs"),
    ],
)
def test_yaml_that_is_damaged_is_refused_in_one_sentence(tmp_path, text, reason):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=reason) as caught:
        load_robot(str(path))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 700


def test_bytes_that_are_no_text_and_a_byte_order_mark(tmp_path, plain):
    path = tmp_path / "bytes.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"bytes\.yaml is not a robot file"):
        load_robot(str(path))
    marked = write_made_up(tmp_path / "marked.yaml", made_up_urdf())
    marked.write_bytes(b"\xef\xbb\xbf" + marked.read_bytes())
    np.testing.assert_array_equal(load_robot(str(marked)).axes, plain.axes)


@pytest.mark.parametrize("name", ["../up", "a/b", "..", "x" * 65, "a b"])
def test_name_that_would_be_a_path_is_refused(tmp_path, name):
    """Motion files lie in motions/NAME."""
    path = write_made_up(tmp_path / "made_up.yaml", made_up_urdf())
    path.write_text(f"name: '{name}'\n" + path.read_text())
    with pytest.raises(InputError, match="must be letters, digits"):
        load_robot(str(path))
