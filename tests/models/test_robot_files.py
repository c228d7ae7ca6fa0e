import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.models.meshes import vendor_folder
from loco_drake.models.robot_files import is_robot_file
from loco_drake.models.robots import get_robot, load_robot
from tests.robot_files import SOLO8, write_robot

URDF = "robots/solo_description/robots/solo.urdf"


def spoiled(tmp_path, *changes):
    """Path of the example with each (old, new) of its text replaced once."""
    text = SOLO8.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "my_solo8.yaml"
    path.write_text(text)
    return str(path)


def test_shipped_robots_keep_their_names():
    assert load_robot("a1") is get_robot("a1")
    assert get_robot("a1").definition == "a1"
    assert (is_robot_file("a1"), is_robot_file("x/a1.yaml")) == (False, True)


def test_example_is_read_as_it_is_written():
    robot = load_robot(str(SOLO8))
    assert (robot.name, len(robot.joint_names)) == ("solo8", 8)
    assert robot.joint_names[4:6] == ("HL_HFE", "HL_KFE")
    np.testing.assert_array_equal(robot.joint_lower[[1, 5]], [-2.8, 0.1])
    np.testing.assert_array_equal(robot.joint_upper[[1, 5]], [-0.1, 2.8])
    np.testing.assert_array_equal(robot.joint_speed_limits, 84.0)
    assert load_robot(robot.definition).joint_names == robot.joint_names
    with pytest.raises(ValueError, match="read-only"):
        robot.stand_joints[0] = 1.0


def test_limits_of_the_urdf_hold_where_the_file_has_none(tmp_path):
    robot = load_robot(str(write_robot(tmp_path / "beast.yaml", "laikago")))
    assert robot.name == "beast"
    # Hip, thigh and calf may go from -50, -30 and -159 degrees on.
    degrees = np.rad2deg(robot.joint_lower[:3])
    np.testing.assert_allclose(degrees, [-50, -30, -159], atol=0.01)
    assert (robot.joint_lower < robot.stand_joints).all()


def test_urdf_beside_the_file_and_name_in_it(tmp_path):
    (tmp_path / "solo.urdf").write_bytes((vendor_folder() / URDF).read_bytes())
    change = (f"package://example-robot-data/{URDF}", "solo.urdf\nname: bert")
    assert load_robot(spoiled(tmp_path, change)).name == "bert"


def test_packages_of_ros_are_found(tmp_path, monkeypatch):
    folder = tmp_path / "ros" / "mine"
    folder.mkdir(parents=True)
    package = '<package format="2"><name>mine</name></package>'
    (folder / "package.xml").write_text(package)
    (folder / "solo.urdf").write_bytes((vendor_folder() / URDF).read_bytes())
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    change = (f"package://example-robot-data/{URDF}", "package://mine/solo.urdf")
    assert load_robot(spoiled(tmp_path, change)).name == "my_solo8"


def test_joints_that_belong_to_no_leg_are_held_at_zero(tmp_path):
    """Solo12 with its abduction locked is planar: toes keep their distance."""
    text = SOLO8.read_text().replace("solo.urdf", "solo12.urdf")
    (tmp_path / "locked.yaml").write_text(text)
    robot = load_robot(str(tmp_path / "locked.yaml"))
    assert len(robot.joint_names) == 8
    toes = robot.toe_positions(np.array([[0.3, -0.9] * 2 + [0.1, 0.4] * 2]))
    stand = robot.toe_positions(robot.stand_joints)
    np.testing.assert_allclose(toes[0, :, 1], stand[:, 1], atol=1e-12)


FL = "joints: [FL_HFE, FL_KFE]"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("urdf: package", "# package"), "It lacks urdf."),
        (("trunk: base_link", ""), "It lacks trunk."),
        (("foot_radius: 0.016", ""), "foot_radius must be above 0 m, not 0.0"),
        (("foot: FL_FOOT, ", ""), "Leg FL lacks foot."),
        (("stand: [0.8, -1.6],", ""), "Leg FL lacks stand."),
        (
            ("trunk: base_link", "trunk: torso"),
            "Unknown trunk 'torso'; the choices are",
        ),
        (
            ("foot: FL_FOOT", "foot: PAW"),
            "Unknown foot 'PAW'; the choices are base_link",
        ),
        ((FL, "joints: [FL_HIP, FL_KFE]"), "Unknown joint 'FL_HIP'; the choices are"),
        (("[FR_HFE, FR_KFE]", "[FR_KFE]"), "as many joints, but FL has 2 and FR 1"),
        (
            (FL, "joints: [FL_KFE]"),
            "stand of leg FL must be 1 numbers, one for each joint",
        ),
        (
            (FL, "joints: [FL_KFE, FL_HFE]"),
            "moved by the joints FL_HFE, FL_KFE, in this",
        ),
        ((FL, "joints: [FL_KFE, FL_KFE]"), "one leg, but FL_KFE is named twice"),
        ((FL, "joints: [FL_HFE, FR_KFE]"), "one leg, but FR_KFE is named twice"),
        (("foot: FL_FOOT", "foot: FR_FOOT"), "Foot FR_FOOT of leg FL is moved by the"),
        ((FL, "joints: [FL_HFE, FL_ANKLE]"), "Joint FL_ANKLE is fixed; only revolute"),
        (("lower: [-2.0, -2.8]", "lower: [-2.0]"), "lower of leg FL must be 2 numbers"),
        (("speed: [84, 84]", "speed: [84, 0]"), "speed of leg FL must be above 0"),
        (
            ("stand: [0.8, -1.6]", "stand: [0.8, 1.6]"),
            "FL_KFE at 1.6 rad is not within",
        ),
        (("solo.urdf", "none.urdf"), "There is no URDF '.*none.urdf'"),
        (
            ("//example-robot-data", "//other"),
            "Unknown package 'other'; the choices are",
        ),
        (("  RR:", "  HR:"), "legs must be FL, FR, RL, RR, not FL, FR, HR, RL"),
        (("legs:", "arms: 2\nlegs:"), "is not a robot file: .*arms"),
        (("foot_radius: 0.016", "foot_radius: big"), "is not a robot file: "),
        (
            ("trunk: base_link", "trunk: base_link\nname: go2"),
            "The name 'go2' is taken",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path, change, reason):
    with pytest.raises(InputError, match=reason) as caught:
        load_robot(spoiled(tmp_path, change))
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "my_solo8.yaml"))
    assert "\n" not in message


def test_files_that_are_not_there_or_no_robots(tmp_path):
    with pytest.raises(
        InputError, match=r"There is no file 'no\.yaml'; it should be a"
    ):
        load_robot("no.yaml")
    with pytest.raises(InputError, match="'spot'; the choices are go2, a1, or a robot"):
        load_robot("spot")
    (tmp_path / "list.yaml").write_text("- 1\n")
    with pytest.raises(InputError, match="is not a robot file"):
        load_robot(str(tmp_path / "list.yaml"))
    (tmp_path / "solo.urdf").write_text("<robot><link")
    url = f"package://example-robot-data/{URDF}"
    with pytest.raises(InputError, match="is not XML"):
        load_robot(spoiled(tmp_path, (url, "solo.urdf")))
    (tmp_path / "solo.urdf").write_text(
        "<robot name='a'><joint type='revolute' name='FL_HFE'/></robot>"
    )
    with pytest.raises(
        InputError, match="Unknown joint 'FL_KFE'; the choices are FL_HFE"
    ):
        load_robot(spoiled(tmp_path, (url, "solo.urdf")))


def test_feet_above_the_trunk_are_refused(tmp_path):
    """Thighs turned up by pi."""
    changes = [("lower: [-2.0,", "lower: [-4,"), ("upper: [2.0,", "upper: [4,")] * 4
    stands = [("stand: [0.8,", "stand: [-2.34,")] * 2
    stands += [("stand: [-0.8,", "stand: [2.34,")] * 2
    with pytest.raises(InputError, match="the feet are not below the trunk"):
        load_robot(spoiled(tmp_path, *changes, *stands))
