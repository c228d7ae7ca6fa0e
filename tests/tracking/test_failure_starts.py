import numpy as np
import pytest

from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.failure_starts import FailureStarts
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.workers import WorkerVecEnv

PLAN_STARTS = 3  # bins that plans of 3 s can be started in


def test_a_bin_where_all_episodes_fail_is_drawn_as_the_formula_says(plans):
    """All fail in the second of three: g = (1/2, 1, 0) f, with a floor of .3 / 3."""
    starts = FailureStarts(plans, weight=0.7)
    for _ in range(5):
        starts.record(0, 60, 75, failed=True)
    expected = 0.1 + 0.7 * np.array([1 / 3, 2 / 3, 0.0])
    np.testing.assert_allclose(starts.probabilities(0, PLAN_STARTS), expected)
    random = np.random.default_rng(0)
    drawn = np.array([starts.draw(0, 140, random) for _ in range(20_000)])
    shares = np.bincount(drawn // 50) / len(drawn)
    np.testing.assert_allclose(shares, expected, atol=0.01)
    # Within a bin uniformly; the last one ends early.
    assert set(drawn[drawn >= 100]) == set(range(100, 141))
    within = np.bincount(drawn[(drawn >= 50) & (drawn < 100)] - 50, minlength=50)
    np.testing.assert_allclose(within / within.sum(), 0.02, atol=0.006)
    # Another plan does not know of it.
    np.testing.assert_allclose(starts.probabilities(1, PLAN_STARTS), 1 / 3)


def test_failure_rates_are_exponential_means_over_visits(plans):
    """Through all of it, then from the second bin into the third, where it falls."""
    starts = FailureStarts(plans, weight=1.0)
    starts.record(0, 0, 149, failed=True)
    np.testing.assert_allclose(starts.rates[0][:3], [0, 0, 0.2])
    starts.record(0, 0, 120, failed=False)
    np.testing.assert_allclose(starts.rates[0][:3], [0, 0, 0.16])
    starts.record(0, 55, 110, failed=True)
    np.testing.assert_allclose(starts.rates[0][:3], [0, 0, 0.328])
    starts.record(0, 10, 20, failed=True)
    np.testing.assert_allclose(starts.rates[0][:3], [0.2, 0, 0.328])


def test_what_follows_a_bin_counts_for_it_although_nothing_starts_there(plans):
    """Plans of 3 s that are started in their first bin only fail in the third."""
    starts = FailureStarts(plans, weight=1.0)
    starts.record(0, 120, 140, failed=True)
    np.testing.assert_allclose(starts.probabilities(0, 2), [1 / 3, 2 / 3])
    np.testing.assert_allclose(starts.probabilities(0, 1), [1.0])


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_without_failures_or_without_weight_all_bins_are_alike(weight, plans):
    starts = FailureStarts(plans, weight)
    if weight == 0:
        starts.record(0, 0, 40, failed=True)
    np.testing.assert_allclose(starts.probabilities(0, 3), 1 / 3)


@pytest.mark.slow
def test_episodes_start_where_others_failed(plans):
    """Thrown about, all fail soon: starts are then where episodes ended, or before."""
    sampler = PlanSampler(plans, 0, failure_weight=1.0, half_episode=10)
    sampler.starts.rates[:, 2] = 1.0
    environment = EnvironmentConfig(episode_steps=20, failure_weight=1.0)
    workers = WorkerVecEnv(plans, environment, sampler, workers=1, per_worker=8, seed=0)
    random = np.random.default_rng(0)
    starts, retried, before = [], np.zeros(8, dtype=bool), sampler.starts.rates.copy()
    try:
        workers.reset()
        for _ in range(80):
            actions = random.uniform(-6, 6, (8, 12)).astype(np.float32)
            _, _, dones, infos = workers.step(actions)
            for i in np.flatnonzero(dones):
                start, end = infos[i]["samples"]
                assert start < end <= start + 20
                starts += [] if retried[i] else [start]
                retried[i] = infos[i]["retried"]
    finally:
        workers.close()
    assert len(starts) > 20
    # g = (1, 2, 4) / 7 of the rates that were set, and of similar ones later.
    assert np.mean(np.array(starts) >= 50) > 0.6
    assert max(starts) <= 150 - 10
    assert not np.array_equal(sampler.starts.rates, before)
