"""A robot's motion as keypoints, for another robot."""

import numpy as np
import pytest

from loco_drake.common.rotations import quat_rotate
from loco_drake.models.robots import get_robot
from loco_drake.motion.quality import toe_trajectories
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.robot_clip import config_of, keypoints_of
from loco_drake.retargeting.scaling import Variant
from tests.synthetic_motion import synthetic_motion


def moved(motion, target, **options):
    known = get_robot(motion.robot)
    return retarget_clip(
        keypoints_of(motion, known),
        get_robot(target),
        config=config_of(known),
        contacts=motion.contacts,
        **options,
    )


@pytest.mark.parametrize("name", ["go2", "a1"])
def test_a_robots_motion_is_its_own_again(name):
    """Withers and hip, scale and hips cancel; filters and clearance change little."""
    motion = synthetic_motion(seconds=3.0, name=name, turn=0.3)
    again, report = moved(motion, name)
    assert report.scale == pytest.approx(1.0)
    assert (again.contacts == motion.contacts).all()
    assert not report.warnings
    joints = again.joint_positions - motion.joint_positions
    assert np.sqrt((joints**2).mean()) < 0.02
    assert np.abs(again.base_position - motion.base_position).max() < 3e-3


def test_toes_keep_their_places_under_the_virtual_hips():
    """Distances from these, and heights, are larger by the ratio of the robots'."""
    motion = synthetic_motion(seconds=3.0, name="go2")
    other, report = moved(motion, "a1")
    alpha = get_robot("a1").stand_height / get_robot("go2").stand_height
    assert report.scale == pytest.approx(alpha)
    reach = []
    for one in (motion, other):
        robot = get_robot(one.robot)
        p_WV = one.base_position[:, None] + quat_rotate(
            one.base_quaternion[:, None], robot.p_BV
        )
        reach.append(toe_trajectories(one, robot) - p_WV)
    given, found = (x[25:-25, ..., :2] for x in reach)
    assert np.abs(found - alpha * given).max() < 0.006
    heights = other.base_position[:, 2] - alpha * motion.base_position[:, 2]
    assert np.abs(heights).max() < 0.003
    travelled = other.base_position[-1, 0] / motion.base_position[-1, 0]
    assert travelled == pytest.approx(alpha, rel=0.01)


def test_known_contacts_are_mirrored_with_the_clip():
    motion = synthetic_motion("dog-pace", seconds=2.0, name="go2", phase=0.2)
    other, report = moved(motion, "a1", variant=Variant(mirror=True))
    assert report.mirrored
    assert (other.contacts == motion.contacts[:, [1, 0, 3, 2]]).all()
    assert (other.contacts != motion.contacts).any()
