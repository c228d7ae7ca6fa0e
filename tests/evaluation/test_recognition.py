from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.recognition import (
    confusion_matrix,
    linear_recognizer,
    recognize,
)
from loco_drake.evaluation.samples import join, make_samples
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from tests.varied_motion import varied_motions

GO2 = get_robot("go2")
NAMES = ("dog-pace", "dog-trot", "mpc-trot")
PACE, DOG_TROT, MPC_TROT = (parse_label(name).index for name in NAMES)
ROWS = (
    "real_to_real",
    "real_to_generated",
    "generated_to_real",
    "generated_to_real_matched",
)


def motions(count, seed, split="train"):
    """Pace, trot, and trot that is 6 cm higher."""
    made = []
    for name in NAMES:
        for motion in varied_motions(name, count, seed, split=split):
            lift = 0.06 * (name == "mpc-trot")
            lifted = motion.base_position + np.array([0.0, 0.0, lift])
            made.append(replace(motion, base_position=lifted))
    return made


def samples(count, seed, split="train"):
    return make_samples(GO2, motions(count, seed, split))


def relabelled(samples, old, new):
    labels = np.where(samples.labels == old, new, samples.labels)
    return replace(samples, labels=labels)


@pytest.fixture(scope="module")
def real():
    return samples(12, 0), samples(4, 0, "validation")


def test_generated_motion_like_recordings_scores_one(real):
    found = recognize(
        linear_recognizer, *real, [samples(16, 1), samples(16, 2)], [0, 1]
    )
    assert set(found.accuracies) == set(ROWS)
    for row in ROWS:
        assert set(found.accuracies[row]) == {"all", "dog", "mpc"}
        for estimate in found.accuracies[row].values():
            assert estimate.mean == pytest.approx(1.0)
            assert estimate.low < 0.97 < estimate.high
        np.testing.assert_array_equal(found.confusion[row], np.eye(3))
    # 96 generated trajectories say more than 12 recorded ones.
    generated, recorded = (found.accuracies[row]["all"] for row in ROWS[1::-1])
    assert generated.low > recorded.low


def test_a_generator_that_writes_the_wrong_gait(real):
    """What it calls a dog's trot is its pace: a third is wrong, and half of the dog's.

    Learning from it, all paces seem to be trots or paces at random, trots are unknown.
    """
    good = samples(16, 1)
    paces = samples(16, 3)
    paces = relabelled(paces[paces.labels == PACE], PACE, DOG_TROT)
    keep = good[good.labels != DOG_TROT]
    wrong = join((keep, paces))
    found = recognize(linear_recognizer, *real, [wrong], [0])
    quality = found.accuracies["real_to_generated"]
    assert quality["all"].mean == pytest.approx(2 / 3)
    assert quality["dog"].mean == pytest.approx(1 / 2)
    assert quality["mpc"].mean == 1.0
    np.testing.assert_array_equal(
        found.confusion["real_to_generated"], [[1, 0, 0], [1, 0, 0], [0, 0, 1]]
    )
    assert found.accuracies["generated_to_real"]["all"].mean < 0.7
    assert found.accuracies["real_to_real"]["all"].mean == pytest.approx(1.0)


def test_a_generator_that_always_writes_the_same_lacks_diversity(real):
    """Every motion can be told, and yet nothing is learned of trots at other speeds."""
    train, validation = real
    one = [
        np.flatnonzero(train.labels == label)[0] for label in np.unique(train.labels)
    ]
    copies = train[np.repeat(one, 16)]
    found = recognize(linear_recognizer, train, validation, [copies], [0])
    assert found.accuracies["real_to_generated"]["all"].mean == pytest.approx(1.0)
    assert found.accuracies["generated_to_real"]["all"].mean < 0.9


def test_matched_is_no_more_than_recordings_have(real):
    """The classifiers are told apart by how many trajectories they are given."""
    given = []

    def fit(samples, seed):
        given.append(len(samples))
        return linear_recognizer(samples, seed)

    recognize(fit, *real, [samples(16, 1)], [0, 1])
    assert given == [36, 48, 36, 36, 48, 36]
    given.clear()
    recognize(fit, *real, [samples(5, 1)], [0])
    assert given == [36, 15]


def test_confusion_by_hand():
    """Two runs, two trajectories of label 4, one of 9, with their mirror images."""
    answers = np.array([[[4, 4], [4, 9], [9, 9]], [[4, 4], [9, 9], [4, 9]]])
    matrix = confusion_matrix(answers, np.array([4, 4, 9]), np.array([4, 9]))
    np.testing.assert_allclose(matrix, [[5 / 8, 3 / 8], [1 / 4, 3 / 4]])
