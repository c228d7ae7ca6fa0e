import numpy as np
import pytest

from loco_drake.common.runs import intervals
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.contacts import (
    detect_contacts,
    resample_contacts,
)
from loco_drake.retargeting.scaling import ContactConfig, load_config
from tests.synthetic import FPS, STANCE_HEIGHT, make_dog


def clip_of(dog, toes=None):
    toes = dog.toes if toes is None else toes
    return KeypointClip("dog", "x", FPS, dog.withers, dog.hip, toes, provenance={})


@pytest.mark.parametrize("gait", ["pace", "trot", "gallop"])
def test_contacts_are_those_that_the_dog_was_made_with(gait):
    """Swings begin and end gently, so a few frames at each edge may count as stance."""
    dog = make_dog(gait)
    found = detect_contacts(clip_of(dog), STANCE_HEIGHT, load_config("dog").contact)
    assert found[dog.contacts].mean() > 0.98
    stride = dog.gait.period * FPS
    excess = found.sum(axis=0) - dog.contacts.sum(axis=0)
    strides = len(found) / stride
    assert (excess <= 6 * strides).all()
    for leg in range(4):
        landed = np.array([a for a, _ in intervals(found[:, leg]) if a > 0])
        true = np.array([a for a, _ in intervals(dog.contacts[:, leg]) if a > 0])
        assert len(landed) == len(true)
        assert np.abs(landed - true).max() <= 3


def still_dog(toe_height):
    """A dog that stands for 60 frames, toe FL at the given heights."""
    dog = make_dog("pace", 1.0)
    toes = np.zeros((60, 4, 3))
    toes[:, 0, 2] = toe_height
    return KeypointClip(
        "dog", "x", FPS, dog.withers[[0] * 60], dog.hip[[0] * 60], toes, provenance={}
    )


def test_hysteresis_between_the_two_heights_keeps_the_state():
    """Up to .08 in 40 frames and back, H = 1: leaves above .06 and lands below .03."""
    height = np.concatenate((np.linspace(0, 0.08, 30), np.linspace(0.08, 0, 30)))
    config = ContactConfig(land_height=0.03, leave_height=0.06)
    contact = detect_contacts(still_dog(height), 1.0, config)[:, 0]
    expected = np.concatenate((height[:30] <= 0.06, height[30:] < 0.03))
    np.testing.assert_array_equal(contact, expected)


def test_low_toe_that_slides_fast_is_no_contact():
    """1 m/s at ground height: faster than a toe that rolls."""
    clip = still_dog(np.zeros(60))
    clip.toes[:, 0, 0] = np.arange(60) / FPS
    contacts = detect_contacts(clip, 1.0, ContactConfig())
    assert not contacts[:, 0].any()
    assert contacts[:, 1:].all()


def test_short_flights_and_contacts_are_noise():
    """One frame up within a stance is filled, one frame down in a swing dropped."""
    height = np.zeros(60)
    height[10] = 0.2
    height[30:] = 0.2
    height[45] = 0.0
    config = ContactConfig(land_speed=99.0, leave_speed=99.0)
    contact = detect_contacts(still_dog(height), 1.0, config)[:, 0]
    np.testing.assert_array_equal(contact, np.arange(60) < 30)


def test_intervals_are_half_open_runs():
    flags = np.array([1, 1, 0, 0, 1, 0, 1], dtype=bool)
    assert list(intervals(flags)) == [(0, 2), (4, 5), (6, 7)]
    assert list(intervals(flags[2:4])) == []


def test_resampled_contacts_are_those_of_the_nearest_frame():
    """50 Hz frames 0 ... 5 are nearest to 60 Hz frames 0, 1, 2, 4, 5, 6."""
    contacts = np.arange(7)[:, None] % 2 == np.zeros(4)
    expected = contacts[[0, 1, 2, 4, 5, 6]]
    np.testing.assert_array_equal(resample_contacts(contacts, 60.0, 50.0, 6), expected)
