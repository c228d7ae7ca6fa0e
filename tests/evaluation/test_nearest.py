from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.distances import nearest_distances, shifted_distances
from tests.synthetic_motion import synthetic_motion


def test_against_all_shifts_one_by_one():
    random = np.random.default_rng(0)
    stretch = np.cumsum(random.normal(size=(130, 12)), axis=0) * 0.1
    own = np.cumsum(random.normal(size=(2, 100, 12)), axis=1) * 0.1
    for joints, found in zip(own, shifted_distances(own, stretch), strict=True):
        least = np.inf
        for lag in range(-100, 131):
            frames = [i for i in range(100) if 0 <= i + lag < 130]
            if len(frames) >= 50:
                apart = joints[frames] - stretch[[i + lag for i in frames]]
                least = min(least, np.sqrt((apart**2).mean()))
        assert found == pytest.approx(least)


def test_a_copy_is_at_no_distance_wherever_it_was_cut():
    """Also mirrored, and where only half of it overlaps."""
    stretch = synthetic_motion("dog-trot", 5.0, turn=0.2)
    copies = [stretch.slice(start, start + 100) for start in (0, 37, 150)]
    copies.append(stretch.mirrored().slice(20, 120))
    distances = nearest_distances(copies, [stretch])
    np.testing.assert_allclose(distances, 0.0, atol=1e-6)
    half = nearest_distances(copies[1:2], [stretch.slice(0, 87)])
    np.testing.assert_allclose(half, 0.0, atol=1e-6)


def test_noise_is_as_far_as_it_is_strong():
    stretch = synthetic_motion("dog-trot", 4.0)
    noise = 0.1 * np.random.default_rng(0).normal(size=(100, 12))
    copy = stretch.slice(40, 140)
    noisy = replace(copy, joint_positions=copy.joint_positions + noise)
    (distance,) = nearest_distances([noisy], [stretch])
    assert distance == pytest.approx(0.1, rel=0.05)


def test_other_labels_and_ones_own_subject_are_left_out():
    trot = synthetic_motion("dog-trot", 4.0, recording="a")
    pace = synthetic_motion("dog-pace", 4.0, recording="b")
    other = synthetic_motion("dog-trot", 4.0, speed=0.5, recording="c")
    cut = [trot.slice(0, 100)]
    assert nearest_distances(cut, [trot, pace])[0] == pytest.approx(0.0, abs=1e-6)
    assert np.isinf(nearest_distances(cut, [pace]))
    assert np.isinf(nearest_distances(cut, [trot], other_subjects=True))
    (apart,) = nearest_distances(cut, [trot, pace, other], other_subjects=True)
    assert 0.01 < apart < 1.0


def test_stretches_too_short_to_overlap_are_none():
    trot = synthetic_motion("dog-trot", 4.0)
    assert np.isinf(nearest_distances([trot.slice(0, 100)], [trot.slice(0, 49)]))
