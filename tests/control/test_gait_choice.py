"""Scores worked by hand: powers of two, whose logarithms interpolate to simple ones."""

import numpy as np
import pytest

from loco_drake.control.command import CommandRange
from loco_drake.control.gait_choice import (
    LEEWAY,
    MARGIN,
    PAUSE,
    Choice,
    MeasuredGait,
    best_gait,
    next_choice,
)
from loco_drake.evaluation.steering_courses import grid

BOX = CommandRange((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
SLOW, FAST = 3, 1  # any indices


def along(low, high, exponent):
    """A gait that goes forward, whose score is 2 to the ``exponent`` of its speed."""
    within = CommandRange((low, 0.0, 0.0), (high, 0.0, 0.0))
    commands = np.array(grid(within))
    return MeasuredGait(within, commands, 2.0 ** exponent(commands[:, 0]))


@pytest.fixture
def gaits():
    """Scores are alike at .5 m/s; the slow gait gets worse with speed."""
    slow = along(0.0, 1.0, lambda speed: speed)
    return {SLOW: slow, FAST: along(0.0, 2.0, lambda speed: 0.5 + 0 * speed)}


def forward(speed):
    return np.array([speed, 0.0, 0.0])


def test_the_score_is_cost_over_the_square_of_what_is_left_of_the_return():
    """Cost .6 and return 80 with a fall in every other drive: .6 / .4^2 = 3.75."""
    point = {"cost_of_transport": 0.6, "normalized_return": 80.0}
    figures = {
        "range": {
            "forward_mps": [0.5, 0.5],
            "sideways_mps": [0.0, 0.0],
            "yaw_rate_radps": [0.0, 0.0],
        },
        "fall_rate": 0.5,
        "points": [{"command": [0.5, 0.0, 0.0], **point}] * 2,
    }
    gait = MeasuredGait.of_figures(figures)
    assert gait.score(forward(0.5)) == pytest.approx(3.75)
    # Beyond its range it is as good as at the nearest command.
    assert gait.score(forward(3.0)) == pytest.approx(3.75)


def test_between_points_of_an_axis_logarithms_are_linear():
    exponents = {0.0: 0, 0.25: 1, 0.5: 2, 0.75: 1, 1.0: -1}
    gait = along(0.0, 1.0, np.vectorize(exponents.get))
    for speed, exponent in {**exponents, 0.375: 1.5, 0.9: -0.2}.items():
        assert gait.score(forward(speed)) == pytest.approx(2.0**exponent)


def test_axes_add_up_and_corners_tell_what_they_have_beyond():
    """Forward doubles the score, sideways quadruples it; corners are 16, not 8."""
    commands = np.array(grid(BOX))
    exponent = np.abs(commands[:, 0]) + 2 * np.abs(commands[:, 1])
    exponent[13:] = 4
    gait = MeasuredGait(BOX, commands, 2.0**exponent)
    for command, score in (
        ([0, 0, 0], 1),
        ([1, 0, 0], 2),
        ([0, 0.5, 0], 2),
        ([0, 0, 1], 1),
        ([1, 1, 1], 16),
        # 2 of the axes; the corner's further 2, since two axes are at their ends.
        ([1, 0, 1], 4),
        # Half of each: 2^.5 and 2 of the axes, 2^.5 of the corner.
        ([0.5, 0.5, 0.5], 4),
    ):
        assert gait.score(np.array(command, float)) == pytest.approx(score), command


def test_every_measured_point_is_met_but_for_left_and_right():
    random = np.random.default_rng(1)
    within = CommandRange((-0.2, -0.3, -0.6), (1.7, 0.3, 0.6))
    commands = np.array(grid(within))
    scores = random.uniform(0.5, 3.0, len(commands))
    gait = MeasuredGait(within, commands, scores)
    for command, score in zip(commands, scores, strict=True):
        mirrored = np.abs(commands - command * [1, -1, -1]).sum(axis=1).argmin()
        expected = np.sqrt(score * scores[mirrored])
        assert gait.score(command) == pytest.approx(expected)
        assert gait.score(command * [1, -1, -1]) == pytest.approx(expected)


def test_an_axis_too_narrow_for_points_of_its_own_tells_nothing():
    within = CommandRange((0.0, 0.0, -1.0), (1.0, 0.01, 1.0))
    commands = np.array(grid(within))
    assert len(set(commands[:, 1])) == 1
    exponent = np.zeros(len(commands))
    exponent[-4:] = 2
    gait = MeasuredGait(within, commands, 2.0**exponent)
    for sideways in (0.0, 0.005, 0.01):
        assert gait.score(np.array([1.0, sideways, 1.0])) == pytest.approx(4)
        assert gait.score(np.array([1.0, sideways, 0.0])) == pytest.approx(1)


def test_the_best_is_a_gait_whose_range_holds_the_command(gaits):
    assert best_gait(gaits, forward(0.4)) == SLOW
    assert best_gait(gaits, forward(0.6)) == FAST
    cheap = {**gaits, 7: along(0.0, 0.3, lambda speed: -9 + 0 * speed)}
    assert best_gait(cheap, forward(0.3)) == 7
    assert best_gait(cheap, forward(0.31)) == SLOW


def test_beyond_all_ranges_the_nearest_counts_whatever_its_score(gaits):
    gaits[FAST] = along(0.0, 2.0, lambda speed: 9 + 0 * speed)
    assert best_gait(gaits, forward(3.0)) == FAST
    # Turning is beyond both alike.
    assert best_gait(gaits, np.array([0.5, 0.0, 1.0])) == SLOW


def sweep(gaits, speeds, first, every=PAUSE):
    """Returns the choices at speeds ``every`` s apart, from a gait on."""
    choice, labels = Choice(first), []
    for k, speed in enumerate(speeds):
        choice = next_choice(gaits, forward(speed), choice, k * every)
        labels.append(choice.label)
    return np.array(labels)


def test_a_gait_changes_at_another_speed_up_than_down(gaits):
    """Where one score is .85 of the other: log2(1/.85) = .2345 from .5 m/s."""
    speeds = np.arange(0.0, 1.0, 0.001)
    up = sweep(gaits, speeds, SLOW)
    down = sweep(gaits, speeds[::-1], FAST)[::-1]
    away = np.log2(1 / (1 - MARGIN))
    assert away == pytest.approx(0.2345, abs=1e-4)
    assert speeds[np.argmax(up == FAST)] == pytest.approx(0.5 + away, abs=0.002)
    assert speeds[np.argmax(down == FAST)] == pytest.approx(0.5 - away, abs=0.002)


@pytest.mark.parametrize("first", [SLOW, FAST])
def test_hovering_about_a_boundary_does_not_change_the_gait(gaits, first):
    for speed in (0.5, 0.7, 0.3):
        speeds = speed + 0.03 * np.sin(np.arange(200))
        assert set(sweep(gaits, speeds, first)) == {first}


def test_hovering_about_the_end_of_a_range_changes_it_once(gaits):
    """The slow gait is the better one by far, and its range ends at 1 m/s."""
    gaits[FAST] = along(0.9, 2.0, lambda speed: 3 + 0 * speed)
    within = 1.0 + 0.09 * np.sin(np.arange(100))
    assert set(sweep(gaits, within, SLOW)) == {SLOW}
    assert sweep(gaits, [1.0 + LEEWAY - 0.01, 1.0 + LEEWAY + 0.01], SLOW).tolist() == [
        SLOW,
        FAST,
    ]
    beyond = 1.06 + 0.05 * np.sin(np.arange(100))
    changes = np.diff(sweep(gaits, beyond, SLOW))
    assert np.count_nonzero(changes) == 1


def test_a_gait_is_kept_for_a_while_unless_it_cannot_follow(gaits):
    choice = next_choice(gaits, forward(0.9), Choice(SLOW, 0.0), 10.0)
    assert choice == Choice(FAST, 10.0)
    for time, label in ((10.1, FAST), (9.9 + PAUSE, FAST), (10.0 + PAUSE, SLOW)):
        assert next_choice(gaits, forward(0.1), choice, time).label == label
    choice = next_choice(gaits, forward(0.1), choice, 10.0 + PAUSE)
    assert next_choice(gaits, forward(1.5), choice, 10.08 + PAUSE).label == FAST


def test_a_gait_that_was_not_measured_is_left_at_once(gaits):
    assert next_choice(gaits, forward(0.1), Choice(14, 0.0), 0.1) == Choice(SLOW, 0.1)
