import numpy as np
import pytest

from loco_drake.generation.features import SIZE
from loco_drake.generation.speed_rank import (
    BINS,
    drawn_rank,
    rank_bin,
    speed_edges,
    token_speeds,
)
from loco_drake.motion.gaits import parse_label

TROT = parse_label("dog-trot").index


def test_speed_around_a_token_is_averaged_over_two_seconds():
    """A speed that swings once a second about a ramp is the ramp."""
    time = np.arange(400) / 50
    features = np.zeros((402, SIZE))
    features[:400, 0] = 1 + 0.1 * time + np.sin(2 * np.pi * time)
    speeds = token_speeds(features, 4)
    assert speeds.shape == (100,)
    middle = slice(15, 85)
    ramp = 1 + 0.1 * (4 * np.arange(100) + 1.5) / 50
    np.testing.assert_allclose(speeds[middle], ramp[middle], atol=0.005)


def test_every_bin_holds_as_much_motion():
    random = np.random.default_rng(0)
    speeds = [random.gamma(2.0, size=n) for n in (5000, 3000)]
    edges = speed_edges([(TROT, each) for each in speeds])
    bins = np.searchsorted(edges[TROT], np.concatenate(speeds))
    np.testing.assert_allclose(np.bincount(bins) / 8000, 1 / BINS, atol=2e-3)
    assert (edges[TROT + 1] == 0).all()


def test_ranks_are_bins_from_slowest_to_fastest():
    ranks = np.array([0.0, 0.06, 0.07, 0.5, 1.0])
    assert rank_bin(ranks).tolist() == [0, 0, 1, 8, 15]


def test_seeds_draw_ranks_of_their_own_evenly():
    ranks = drawn_rank(np.arange(2000))
    np.testing.assert_array_equal(ranks[7:8], drawn_rank(np.array([7])))
    assert np.quantile(ranks, [0.25, 0.5, 0.75]) == pytest.approx(
        [0.25, 0.5, 0.75], abs=0.03
    )
