from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.gait_change import (
    change_figure,
    forward_speed,
    peaks,
    roughness,
)
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_schedule
from tests.synthetic_motion import synthetic_motion

GO2 = get_robot("go2")
SCHEDULE = parse_schedule("dog-pace,dog-trot@2")


@pytest.fixture(scope="module")
def motion():
    return synthetic_motion("dog-trot", 4.0, 0.5)


def test_peaks_of_motion_worked_by_hand(motion):
    """One joint steps by .2 rad, one velocity by 3 m/s, the base by 4 cm sideways."""
    still = motion.slice(0, 1)
    frames = np.zeros(10, dtype=int)
    arrays = {
        name: getattr(still, name)[frames].copy()
        for name in (
            "base_position",
            "base_quaternion",
            "joint_positions",
            "base_velocity",
            "base_angular_velocity",
            "joint_velocities",
            "contacts",
        )
    }
    arrays["joint_positions"][5:, 7] += 0.2
    arrays["base_position"][4:, 1] -= 0.04
    arrays["base_velocity"][3, 0] += 3.0
    found = peaks(replace(still, **arrays))
    assert found == pytest.approx(
        {
            "joint_step_rad": 0.2,
            "joint_acceleration_rad_s2": 0.0,
            "base_step_m": 0.04,
            "base_acceleration_mps2": 3.0 * 50,
            "base_turn_acceleration_rad_s2": 0.0,
        }
    )


def test_no_change_is_no_rougher_than_the_gait(motion):
    assert max(roughness(motion, 2.0, [motion]).values()) <= 1.0


def test_a_jump_shows(motion):
    """A leg that is elsewhere at once, and the same a second away from the change."""
    joints = motion.joint_positions.copy()
    joints[100:, 1] += 0.5
    jumping = replace(motion, joint_positions=joints)
    assert roughness(jumping, 2.0, [motion])["joint_step_rad"] > 2
    assert roughness(jumping, 3.0, [motion])["joint_step_rad"] <= 1
    assert roughness(jumping, 2.0, [motion])["base_step_m"] <= 1


def test_speed_is_along_the_heading(motion):
    np.testing.assert_allclose(forward_speed(GO2, motion).mean(), 0.5, atol=0.02)


def test_the_picture_shows_every_stance_and_names_the_gaits(motion):
    figure = change_figure(GO2, motion, SCHEDULE)
    feet, speed = figure.axes
    assert [text.get_text().strip() for text in feet.texts] == ["dog-pace", "dog-trot"]
    shown = sum(
        path.vertices[:, 0].max() - path.vertices[:, 0].min()
        for bars in feet.collections
        for path in bars.get_paths()
    )
    assert shown == pytest.approx(motion.contacts.sum() / motion.fps)
    assert len(speed.lines[0].get_xdata()) == len(motion)
