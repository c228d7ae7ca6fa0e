import numpy as np
import pytest

from loco_drake.control.plan import PLAN_DT, plan_from_motion
from loco_drake.evaluation.gait_change_time import (
    footfalls,
    gait_change_figures,
    gait_change_time,
)
from tests.synthetic_motion import synthetic_motion

PACE, TROT = 0, 1
SPEED = np.array([0.6, 0.0, 0.0])


@pytest.fixture(scope="module")
def gaits(go2):
    """Ten seconds of each gait at .6 m/s, with strides of .5 s."""
    return {
        label: plan_from_motion(go2, synthetic_motion(name, 10.0, 0.6)).q
        for label, name in ((PACE, "dog-pace"), (TROT, "dog-trot"))
    }


def changing(gaits, first, then, at, slower=0.0):
    """A pace until ``at``, samples, and then another gait, from where the robot is.

    ``slower`` is taken off the velocity of the part that follows, m/s, for 1 s.
    """
    q = np.concatenate((gaits[first][:at], gaits[then][at:500]))
    late = np.clip(np.arange(500) - at, 0, round(1 / PLAN_DT)) * PLAN_DT
    q[:, 4] -= slower * late
    return q


def labels(first, then, at, samples=500):
    return np.where(np.arange(samples) < at, first, then)


def test_footfalls_are_shares_of_a_stride(go2, gaits):
    """Of a pace, feet of one side do the same, and of a trot those of a diagonal."""
    for label, alike in ((PACE, (5, 8)), (TROT, (6, 7))):
        shares = footfalls(go2, gaits[label], 0.5)[100:-100]
        assert shares.shape[1] == 10
        # The stance, and what of the swing is below .06 h, the swing's height being
        # .06 m times the square of a sine.
        down = 0.5 + np.arcsin(np.sqrt(go2.stand_height)) / np.pi
        np.testing.assert_allclose(shares[:, :4].mean(axis=0), down, atol=0.02)
        # Pairs FL-FR, FL-RL, FL-RR, FR-RL, FR-RR, RL-RR.
        for pair in range(4, 10):
            assert (shares[:, pair].mean() > 0.9) == (pair in alike)


def test_a_change_is_complete_when_the_feet_have_changed(go2, gaits):
    """Where label and velocity are early, the footfalls decide: .9 of a stride past.

    The stride is centred at its sample: 90 % of it lie behind a change that is .4
    strides, .2 s, before its middle.
    """
    q = changing(gaits, PACE, TROT, at=300)
    time = gait_change_time(go2, q, labels(PACE, TROT, 260), 250, SPEED)
    assert time == pytest.approx(50 * PLAN_DT + 0.2, abs=0.06)


def test_a_change_is_complete_when_the_plan_says_so_for_good(go2, gaits):
    """Here between gaits whose footfalls are the same."""
    q = changing(gaits, TROT, TROT, at=300)
    told = labels(TROT, 7, 270)
    assert gait_change_time(go2, q, told, 250, SPEED) == pytest.approx(20 * PLAN_DT)
    told[320] = TROT
    assert gait_change_time(go2, q, told, 250, SPEED) == pytest.approx(71 * PLAN_DT)


def test_a_change_is_complete_when_the_robot_has_its_new_pace(go2, gaits):
    """It is .5 m/s too slow for a second, as a mean over a stride until later."""
    q = changing(gaits, TROT, TROT, at=250, slower=0.5)
    time = gait_change_time(go2, q, labels(TROT, 7, 252), 250, SPEED)
    # Of a stride of .5 s the slow part must be below .11 of .5 m/s.
    assert time == pytest.approx(1.0 + 0.25 - 0.22 * 0.5, abs=0.06)
    never = np.array([1.5, 0.0, 0.0])
    assert gait_change_time(go2, q, labels(TROT, 7, 252), 250, never) is None


def test_figures_are_of_all_changes_before_a_fall(go2, gaits):
    period = 200
    q = np.concatenate((gaits[PACE][:230], gaits[TROT][230:500]))
    told = labels(PACE, TROT, 210)
    figures = gait_change_figures(go2, q, told, [SPEED] * 4, period)
    assert figures["gait_changes"] == 3
    assert figures["gait_changes_completed"] == 1
    assert figures["gait_change_s"] == figures["gait_change_max_s"]
    assert figures["gait_change_s"] == pytest.approx(30 * PLAN_DT + 0.2, abs=0.06)
    fallen = gait_change_figures(go2, q[:300], told, [SPEED] * 4, period)
    assert fallen["gait_change_s"] is None
    assert fallen["gait_changes_completed"] == 0
