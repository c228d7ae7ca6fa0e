"""Success, recovery and the 80 % level against numbers worked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.robustness import (
    recovery_band,
    recovery_time,
    succeeded,
    success_threshold,
)
from tests.rollouts import straight_ahead

STEPS = 300  # 6 s
TIME = 0.02 * np.arange(STEPS + 1)


@pytest.fixture
def perfect():
    return straight_ahead(STEPS)


def with_state(rollout, column, values):
    state = rollout.state.copy()
    state[:, column] = values
    return replace(rollout, state=state)


def test_who_follows_succeeds_and_who_falls_does_not(perfect):
    assert succeeded(perfect)
    assert not succeeded(replace(perfect, fell=True))


def test_what_counts_is_the_last_two_seconds_and_not_the_place(perfect):
    """Elsewhere by 5 m since 1 s, but moving along: a success."""
    assert succeeded(with_state(perfect, 5, np.where(TIME > 1.0, 5.0, 0.0)))


@pytest.mark.parametrize(
    ("speed", "expected"), [(0.0, False), (0.3, False), (0.5, True)]
)
def test_who_stays_behind_fails(perfect, speed, expected):
    """Slower by d, the root of the mean square over 2 s is d 2 / sqrt(3), .3 at .26."""
    assert succeeded(with_state(perfect, 4, speed * TIME)) == expected


def test_who_lies_low_or_turns_away_fails(perfect):
    assert not succeeded(with_state(perfect, 6, -0.05))
    turning = 0.5 * np.maximum(TIME - 4.0, 0.0)  # .58 rad RMS
    state = perfect.state.copy()
    state[:, 0], state[:, 3] = np.cos(turning / 2), np.sin(turning / 2)
    assert not succeeded(replace(perfect, state=state))


def test_recovery_ends_when_the_first_half_second_is_as_without_a_push(perfect):
    """Joints off by .2 rad until .6 s after the push: .6 s, whatever comes later."""
    undisturbed = with_state(perfect, 8, 0.01)
    band = recovery_band(undisturbed)
    np.testing.assert_allclose(band, [0.0, 0.0, 0.01 / np.sqrt(12)], atol=1e-12)
    end = 105
    off = np.where((TIME > 2.0) & (TIME[end] + 0.59 > TIME), 0.2, 0.0)
    pushed = with_state(perfect, 8, off + np.where(TIME > 5.0, 0.3, 0.0))
    assert recovery_time(pushed, end, band) == pytest.approx(0.6)
    assert recovery_time(perfect, end, band) == 0.0
    assert recovery_time(with_state(perfect, 8, 0.2), end, band) is None


def test_a_base_that_is_elsewhere_but_moves_along_has_recovered(perfect):
    """Pushed aside by .5 m within .4 s: the half second after that is aligned."""
    band = np.array([0.01, 0.01, 0.01])
    aside = 0.5 * np.clip((TIME - 2.1) / 0.4, 0.0, 1.0)
    pushed = with_state(perfect, 5, aside)
    assert recovery_time(pushed, 105, band) == pytest.approx(0.4, abs=0.021)


def test_the_level_between_two_levels():
    """.9 at 8 and .5 at 16: .8 is a quarter of the way."""
    found = success_threshold([0, 8, 16], [10, 9, 5], [10, 10, 10])
    assert found.level == pytest.approx(10.0)
    assert not found.beyond
    assert found.low < 10.0 < found.high


def test_shares_that_rise_again_are_pooled():
    """.6 and .9 make .75 of both: .8 lies .2 / .25 of the way from 0 to 8."""
    found = success_threshold([0, 8, 16, 24], [10, 6, 9, 2], [10] * 4)
    assert found.level == pytest.approx(6.4)
    # With weights: 30 of 40 and 9 of 10 are 39 of 50, .78.
    found = success_threshold([0, 8, 16, 24], [10, 30, 9, 2], [10, 40, 10, 10])
    assert found.level == pytest.approx(8 * 0.2 / 0.22)


def test_all_and_none():
    """All survived: at least the last level; even undisturbed too few: the first."""
    every = success_threshold([0, 8, 16], [50, 50, 50], [50, 50, 50])
    assert (every.level, every.beyond, every.high) == (16.0, True, 16.0)
    assert every.low > 8.0
    none = success_threshold([0, 8, 16], [5, 0, 0], [50, 50, 50])
    assert (none.level, none.beyond, none.low) == (0.0, False, 0.0)


def test_levels_that_fall_are_interpolated_downwards():
    """Friction: 1 at .5 and .6 at .3: .8 at .4."""
    found = success_threshold([0.8, 0.5, 0.3], [50, 50, 30], [50, 50, 50])
    assert found.level == pytest.approx(0.4)
    assert 0.3 < found.high < 0.4 < found.low < 0.5


def test_more_episodes_narrow_the_interval():
    few, many = (
        success_threshold([0, 8, 16], [n, int(0.9 * n), n // 2], [n, n, n])
        for n in (10, 1000)
    )
    assert many.high - many.low < 0.3 * (few.high - few.low)
    assert success_threshold([0, 8], [9, 3], [10, 10]) == success_threshold(
        [0, 8], [9, 3], [10, 10]
    )
