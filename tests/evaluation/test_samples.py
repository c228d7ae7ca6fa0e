from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.rotations import quat_multiply, quat_rotate, yaw_quat
from loco_drake.evaluation.samples import (
    FRAMES,
    SUMMARY,
    choose_per_label,
    count_per_label,
    join,
    label_weights,
    make_samples,
    subject_of,
    summarize,
)
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from tests.synthetic_motion import synthetic_motion

GO2 = get_robot("go2")


def test_place_heading_and_contact_labels_make_no_difference():
    motion = synthetic_motion(turn=0.4)
    turn = yaw_quat(np.array(2.0))
    elsewhere = replace(
        motion,
        base_position=quat_rotate(turn, motion.base_position)
        + np.array([3.0, -7.0, 0.0]),
        base_quaternion=quat_multiply(turn, motion.base_quaternion),
        contacts=~motion.contacts,
    )
    a, b = make_samples(GO2, [motion]), make_samples(GO2, [elsewhere])
    assert a.channels.shape == (1, 2, FRAMES, 18)
    np.testing.assert_allclose(a.channels, b.channels, atol=1e-9)
    higher = replace(
        motion, base_position=motion.base_position + np.array([0, 0, 0.01])
    )
    c = make_samples(GO2, [higher])
    assert not np.allclose(a.channels, c.channels, atol=1e-3)


def test_the_second_side_is_the_mirror_image():
    """Turning to the left by .4 rad/s is turning to the right."""
    motion = synthetic_motion(turn=0.4)
    samples = make_samples(GO2, [motion, motion.mirrored()])
    rates = samples.summaries[:, :, 2]
    np.testing.assert_allclose(rates, [[0.4, -0.4], [-0.4, 0.4]], atol=1e-3)
    np.testing.assert_allclose(samples.channels[0], samples.channels[1, ::-1])


def test_summary_by_hand():
    """A channel that climbs by .02 a frame; thighs that swing with and against FL's."""
    channels = np.zeros((FRAMES, 18))
    channels[:, 3] = 0.02 * np.arange(FRAMES)
    swing = np.sin(2 * np.pi * np.arange(FRAMES) / 20)
    channels[:, 7::3] = swing[:, None] * [1.0, -0.5, 0.3, -0.2]
    summary = summarize(channels)
    climbs = [summary[SUMMARY[part]][3] for part in list(SUMMARY)[:4]]
    spread = 0.02 * np.sqrt((FRAMES**2 - 1) / 12)
    np.testing.assert_allclose(climbs, [0.99, spread, 0.02, 0.0], atol=1e-4)
    # FL-FR, FL-RL, FL-RR, FR-RL, FR-RR, RL-RR.
    np.testing.assert_allclose(summary[SUMMARY["correlation"]], [-1, 1, -1, -1, 1, -1])


def test_what_cannot_be_measured_makes_no_difference():
    channels = np.random.default_rng(0).normal(size=(FRAMES, 18)).round(2)
    channels[:, 4] = 0.0
    noisy = channels.copy()
    noisy[:, 4] += 1e-5 * np.sin(np.arange(FRAMES))
    np.testing.assert_array_equal(summarize(channels), summarize(noisy))


def test_labels_weigh_the_same():
    """Three of one label and one of another: 1/6 each against 1/2."""
    weights = label_weights(np.array([4, 4, 4, 9]))
    np.testing.assert_allclose(weights, [1 / 6, 1 / 6, 1 / 6, 1 / 2])


def test_choosing_and_joining():
    paces = [synthetic_motion("dog-pace", recording=f"p{i}") for i in range(4)]
    trots = [synthetic_motion("dog-trot", recording=f"t{i}") for i in range(3)]
    both = join([make_samples(GO2, paces), make_samples(GO2, trots)])
    pace, trot = (parse_label(f"dog-{gait}").index for gait in ("pace", "trot"))
    assert count_per_label(both) == {pace: 4, trot: 3}
    chosen = choose_per_label(both, {pace: 2, trot: 9}, np.random.default_rng(0))
    assert count_per_label(chosen) == {pace: 2, trot: 3}
    assert len(set(chosen.subjects)) == 5


@pytest.mark.parametrize(
    ("provenance", "subject"),
    [
        ({"animal": "Horse3", "recording": "Horse3_M1_trot1"}, "dog-Horse3"),
        ({"recording": "walk00", "file": "walk00.txt"}, "dog-walk00"),
        ({"file": "walk00.txt"}, "dog-walk00.txt"),
        ({"generated": "dog-trot for 2 s"}, None),
    ],
)
def test_subjects(provenance, subject):
    motion = replace(synthetic_motion(), provenance=provenance)
    assert subject_of(motion) == subject


def test_motions_without_a_subject_are_one_each():
    motion = replace(synthetic_motion(), provenance={})
    assert len(set(make_samples(GO2, [motion] * 3).subjects)) == 3
