import numpy as np
import pytest

from loco_drake.evaluation.confidence import accuracy, wilson


@pytest.mark.parametrize(
    ("right", "count", "low", "high"),
    [
        (56, 60, 0.841, 0.974),
        (265, 360, 0.688, 0.779),
        (50, 60, 0.720, 0.907),
        (9, 9, 0.701, 1.0),
        (0, 9, 0.0, 0.299),
    ],
)
def test_wilson_against_known_values(right, count, low, high):
    assert wilson(right / count, count) == pytest.approx((low, high), abs=6e-4)


def names(count):
    return np.array([f"recording {i}" for i in range(count)])


def test_accuracy_weighs_as_told():
    """Right 1, 0, 1/2 in one run and 1, 1, 1/2 in the other, weights .5, .3, .2."""
    correct = np.array([[1.0, 0.0, 0.5], [1.0, 1.0, 0.5]])
    estimate = accuracy(correct, np.array([5.0, 3.0, 2.0]), names(3))
    assert estimate.mean == pytest.approx((0.6 + 0.9) / 2)
    assert 0.0 <= estimate.low < estimate.mean < estimate.high <= 1.0


def test_all_right_is_no_certainty():
    """Runs are no new trials: 5 runs of 9 trajectories are worth 9."""
    estimate = accuracy(np.ones((5, 9)), np.ones(9), names(9))
    assert estimate.mean == pytest.approx(1.0)
    assert (estimate.low, estimate.high) == pytest.approx(wilson(1.0, 9))


def test_trajectories_of_one_recording_count_as_less():
    """90 right and 10 wrong; the wrong ones alone make up one of ten recordings."""
    correct = np.repeat([1.0, 0.0], [90, 10])[None]
    apart = accuracy(correct, np.ones(100), names(100))
    together = accuracy(correct, np.ones(100), np.repeat(names(10), 10))
    assert apart.mean == pytest.approx(together.mean) == pytest.approx(0.9)
    assert together.high - together.low > 1.5 * (apart.high - apart.low)


def test_runs_that_disagree_widen_the_interval():
    steady = np.full((6, 400), 0.75)
    wavering = np.repeat([[1.0], [0.5]], 3, axis=0) * np.ones((6, 400))
    weights, groups = np.ones(400), names(400)
    narrow, wide = (accuracy(c, weights, groups) for c in (steady, wavering))
    assert narrow.mean == pytest.approx(wide.mean)
    assert wide.high - wide.low > 2 * (narrow.high - narrow.low)


def test_the_interval_covers_the_truth_about_as_often_as_it_says():
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(40):
        correct = (random.random((1, 50)) < 0.8).astype(float)
        estimate = accuracy(correct, np.ones(50), names(50))
        hits += estimate.low <= 0.8 <= estimate.high
    assert hits >= 36
