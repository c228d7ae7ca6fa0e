from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.evaluation.tracking import (
    base_errors,
    effort_metrics,
    joint_rmse,
    normalized_return,
    slip_speeds,
    speed,
    stretch,
    tracking_metrics,
)
from loco_drake.models.robots import get_robot
from tests.rollouts import straight_ahead

STEPS = 250  # 5 s: two windows of 2 s and half of a third
TIME = 0.02 * np.arange(STEPS + 1)


@pytest.fixture
def perfect():
    return straight_ahead(STEPS)


def turned(rollout, axis, angle):
    """The robot, not its plan, turned by ``angle`` rad (N,) about an axis."""
    state = rollout.state.copy()
    state[:, :4] = Rotation.from_rotvec(
        np.outer(angle, np.eye(3)["xyz".index(axis)])
    ).as_quat(scalar_first=True)
    return replace(rollout, state=state)


def test_all_as_planned(perfect):
    assert tracking_metrics(perfect) == {
        "normalized_return": pytest.approx(100.0),
        "joint_rmse_rad": 0.0,
        "base_position_rmse_m": 0.0,
        "base_orientation_rmse_rad": 0.0,
        "stretch": pytest.approx(1.0),
        "speed_mps": pytest.approx(0.7),
    }


def test_steps_lost_to_a_fall_earn_nothing(perfect):
    """Down after 100 of 250 steps, all perfect: 40 of 100."""
    cut = {k: getattr(perfect, k)[:101] for k in ("state", "plan_state", "path_time")}
    fallen = replace(perfect, **cut, reward=perfect.reward[:101], fell=True)
    assert normalized_return(fallen) == pytest.approx(40.0)


def test_the_reward_before_the_first_step_does_not_count(perfect):
    reward = np.full(STEPS + 1, 0.5)
    reward[0] = 77.0
    assert normalized_return(replace(perfect, reward=reward)) == pytest.approx(50.0)


def test_joints_by_hand(perfect):
    """One joint of twelve off by .12 rad all the time: .12 / sqrt(12)."""
    perfect.state[:, 9] += 0.12
    assert joint_rmse(perfect) == pytest.approx(0.12 / np.sqrt(12))


def test_where_a_window_starts_is_no_error_but_what_drifts_within_it_is(perfect):
    """Slower by .1 m/s: within windows the lag grows from 0 to .198 m and back to 0."""
    perfect.state[:, 4] -= 0.1 * TIME
    lag = 0.1 * np.concatenate([TIME[:100], TIME[:100], TIME[:51]])
    position, orientation = base_errors(perfect)
    assert position == pytest.approx(np.sqrt(np.mean(lag**2)))
    assert orientation == 0.0


def test_a_constant_heading_error_is_aligned_away(perfect):
    off = turned(perfect, "z", np.full(STEPS + 1, 0.3))
    c, s = np.cos(0.3), np.sin(0.3)
    off.state[:, 4], off.state[:, 5] = 0.7 * TIME * c, 0.7 * TIME * s
    position, orientation = base_errors(off)
    assert position == pytest.approx(0.0, abs=1e-12)
    assert orientation == pytest.approx(0.0, abs=1e-7)


def test_height_and_tilt_are_never_aligned(perfect):
    low = turned(perfect, "y", np.full(STEPS + 1, 0.2))
    low.state[:, 6] -= 0.04
    position, orientation = base_errors(low)
    assert position == pytest.approx(0.04)
    assert orientation == pytest.approx(0.2)


def test_stretch_and_speed(perfect):
    """Played at two thirds of the written speed."""
    slow = replace(perfect, path_time=TIME * 2 / 3)
    assert stretch(slow) == pytest.approx(1.5)
    backwards = turned(perfect, "z", np.full(STEPS + 1, np.pi))
    assert speed(backwards) == pytest.approx(-0.7)


def test_a_robot_that_stands_still_scores_badly(perfect):
    """Joint errors cannot see it; the base's do."""
    still = perfect.state.copy()
    still[:, 4] = 0.0
    still[:, 22] = 0.0
    figures = tracking_metrics(replace(perfect, state=still))
    assert figures["base_position_rmse_m"] > 0.7
    assert figures["speed_mps"] == 0.0


def test_simulated_feet_that_slide_are_seen(perfect):
    """A robot in its stance carried along at .7 m/s slides at .7 m/s on four feet."""
    go2 = get_robot("go2")
    perfect.state[:, 6], perfect.state[:, 7:19] = go2.stand_height, go2.stand_joints
    slip = slip_speeds(perfect, go2)
    assert len(slip) == 4 * STEPS
    np.testing.assert_allclose(slip, 0.7)
    perfect.state[:, 6] += 0.011  # in the air
    assert not len(slip_speeds(perfect, go2))


def test_effort_by_hand(perfect):
    """One joint turns at 2 rad/s against .1 rad of error, another is far from it."""
    go2 = get_robot("go2")
    perfect.desired_joints[:, 1] += 0.1
    perfect.state[:, 26] = 2.0
    perfect.desired_joints[:, 5] += 3.0
    torque = go2.kp[1] * 0.1 - 2.5 * 2.0
    figures = effort_metrics(perfect, go2, np.full(12, 2.5))
    assert figures["torque_saturation"] == pytest.approx(1 / 12)
    assert figures["speed_saturation"] == 0.0
    power = abs(torque) * 2.0  # the other joint does not move
    expected = power / (go2.mass * 9.81 * 0.7)
    assert figures["cost_of_transport"] == pytest.approx(expected)
    perfect.state[:, 25:] = -1.001 * go2.joint_speed_limits
    assert effort_metrics(perfect, go2, go2.kd)["speed_saturation"] == 1.0
