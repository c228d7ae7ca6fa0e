from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.samples import join, make_samples
from loco_drake.evaluation.two_sample import two_sample_accuracy
from loco_drake.models.robots import get_robot
from tests.varied_motion import shaken, varied_motions

GO2 = get_robot("go2")
LABELS = ("dog-pace", "dog-trot")


def samples(seed, count=30, noise=0.0, labels=LABELS):
    motions = [m for label in labels for m in varied_motions(label, count, seed)]
    if noise:
        motions = [shaken(m, noise, seed=i) for i, m in enumerate(motions)]
    return make_samples(GO2, motions)


@pytest.fixture(scope="module")
def real():
    return samples(0)


@pytest.mark.parametrize("fit", ["linear", "kernel"])
def test_motion_of_the_same_kind_is_not_told_apart(real, fit):
    estimate = two_sample_accuracy(real, samples(1), [0], fit)
    assert 0.35 < estimate.mean < 0.65
    assert estimate.low < 0.5 < estimate.high


@pytest.mark.parametrize("fit", ["linear", "kernel"])
def test_a_little_noise_is_told(real, fit):
    """One degree on the joints."""
    estimate = two_sample_accuracy(real, samples(1, noise=0.017), [0], fit)
    assert estimate.mean > 0.95


def test_labels_tell_nothing(real):
    """Even where one set has many more of one label."""
    few = samples(2, count=8, labels=("dog-pace",))
    many = samples(2, count=30, labels=("dog-trot",))
    estimate = two_sample_accuracy(real, join([few, many]), [0, 1])
    assert 0.3 < estimate.mean < 0.7


def test_learning_recordings_by_heart_does_not_help(real):
    """Every trajectory twice under one subject: the copy is in the same fold."""
    index = np.repeat(np.arange(len(real)), 2)
    twice, other = real[index], samples(1)[index]
    assert 0.3 < two_sample_accuracy(twice, other, [0], "kernel").mean < 0.7
    # If folds parted copies, even motion of one kind would seem to be told apart.
    alone = [
        replace(each, subjects=np.array([f"{i}" for i in range(len(each))]))
        for each in (twice, other)
    ]
    assert two_sample_accuracy(*alone, [0], "kernel").mean > 0.7


def test_too_few_recordings_to_tell(real):
    few = real[np.arange(4)]
    assert two_sample_accuracy(few, samples(1), [0]) is None


def test_sets_without_a_common_label(real):
    trots = samples(1, labels=("mpc-trot",))
    assert two_sample_accuracy(real, trots, [0]) is None
