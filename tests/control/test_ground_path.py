import numpy as np
import pytest
from scipy.integrate import solve_ivp

from loco_drake.control.ground_path import (
    filtered,
    ground_pose,
    integrate,
    pace,
    path_velocity,
)
from loco_drake.control.plan import PLAN_DT


def test_the_velocity_along_a_circle_is_constant(trot):
    """The plan runs at .5 m/s and turns at .2 rad/s; its speed is written by hand."""
    velocity = path_velocity(ground_pose(trot.q))
    np.testing.assert_allclose(velocity[:, 0], 0.5, atol=1e-5)
    np.testing.assert_allclose(velocity[:, 1], 0.0, atol=2e-3)
    np.testing.assert_allclose(velocity[:, 2], 0.2, atol=1e-9)


def test_integrating_its_velocity_gives_the_path(trot):
    pose = ground_pose(trot.q)
    back = integrate(pose[0], path_velocity(pose))
    np.testing.assert_allclose(back, pose[1:], atol=1e-12)


def test_a_circle_closes():
    """Half a metre per second and half a turn per second: a radius of .5 / pi."""
    steps = round(2 / PLAN_DT)
    poses = integrate(np.zeros(3), np.tile([0.5, 0.0, np.pi], (steps, 1)))
    np.testing.assert_allclose(poses[-1], [0, 0, 2 * np.pi], atol=1e-12)
    assert poses[:, 1].max() == pytest.approx(2 * 0.5 / np.pi, rel=1e-3)


def test_the_pace_is_the_speed_without_the_swaying_of_a_stride():
    time = np.arange(200) * PLAN_DT
    sway = 0.3 * np.sin(2 * np.pi * 2.5 * time)
    velocity = np.stack((1.0 + sway, sway, 0.5 - sway), axis=1)
    mean = pace(velocity)
    assert mean.shape == (201, 3)
    np.testing.assert_allclose(
        mean[30:-30], np.tile([1.0, 0, 0.5], (141, 1)), atol=8e-3
    )
    # Also at the ends, where half of the window is missing.
    np.testing.assert_allclose(mean, np.tile([1.0, 0, 0.5], (201, 1)), atol=0.1)


def test_the_filter_solves_its_differential_equation():
    command, speed = np.array([1.0, -0.3, 0.5]), np.array([0.2, 0.1, 0.0])
    rate = np.array([2.0, -1.0, 0.0])
    response = 0.6
    x, dx = filtered(command, speed, rate, response, 50)
    omega = 3.8897 / response

    def derivative(_, state):
        here, slope = state[:3], state[3:]
        return np.r_[slope, omega**2 * (command - here) - 2 * omega * slope]

    times = PLAN_DT * np.arange(1, 51)
    truth = solve_ivp(
        derivative, (0, 1), np.r_[speed, rate], t_eval=times, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(x, truth.y[:3].T, atol=1e-8)
    np.testing.assert_allclose(dx, truth.y[3:].T, atol=1e-7)


def test_ninety_per_cent_of_a_step_are_covered_after_the_response_time():
    x, _ = filtered(np.ones(3), np.zeros(3), np.zeros(3), 0.6, 60)
    assert x[29, 0] == pytest.approx(0.9, abs=1e-3)
    assert (np.diff(x[:, 0]) > 0).all()  # and never overshoots
    assert x.max() < 1


def test_a_large_step_is_as_steep_as_the_limit_and_never_overshoots():
    """2 m/s at 3 m/s^2, beside the same filter integrated in steps of 10 us."""
    command, rest = np.array([2.0, 2.0, 0.3]), np.zeros(3)
    steepest = np.array([3.0, np.inf, 3.0])
    x, dx = filtered(command, rest, rest, 0.6, 100, steepest)
    omega, dt, speed, rate = 3.8897 / 0.6, 1e-5, 0.0, 0.0
    truth = []
    for k in range(1, 100001):
        if k % 2000 == 0:
            truth.append((speed, rate))
        wish = rate + dt * (omega**2 * (2.0 - speed) - 2 * omega * rate)
        rate = min(wish, 3.0)
        speed += dt * rate
    np.testing.assert_allclose(x[:50, 0], [s for s, _ in truth], atol=0.02)
    assert dx[:, 0].max() == 3.0
    assert (np.diff(x[:, 0]) > 0).all()
    assert x[:, 0].max() < 2
    # Without a limit its rate is up to 2 omega / e. The other two keep their limits.
    plain, _ = filtered(command, rest, rest, 0.6, 100)
    assert np.diff(plain[:, 0]).max() / PLAN_DT == pytest.approx(4.77, abs=0.05)
    np.testing.assert_array_equal(x[:, 1:], plain[:, 1:])


@pytest.mark.parametrize("split", [3, 10, 20, 40])
def test_a_limited_filter_that_is_stopped_goes_on_as_it_would_have(split):
    command, steepest = np.array([2.5, -2.0, 1.0]), np.full(3, 3.0)
    speed, rate = np.array([-0.5, 0.2, 0.0]), np.array([1.0, 0.0, 0.0])
    whole = filtered(command, speed, rate, 0.6, 80, steepest)
    head = filtered(command, speed, rate, 0.6, split, steepest)
    tail = filtered(command, head[0][-1], head[1][-1], 0.6, 80 - split, steepest)
    for parts, all_ in zip(zip(head, tail, strict=True), whole, strict=True):
        np.testing.assert_allclose(np.concatenate(parts), all_, atol=1e-12)
