import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.control.domain import (
    ERROR_LAYOUT,
    ERROR_SIZE,
    Domain,
    SensorErrors,
    draw_error,
    error_vector,
    measure,
)
from loco_drake.control.observation import OBSERVATION_LAYOUT, observe, preview
from loco_drake.models.robots import get_robot
from loco_drake.systems.domain import Sensors

SIZES = {
    "orientation": 0.1,
    "position": 0.2,
    "joint_positions": 0.3,
    "angular_velocity": 0.4,
    "velocity": 0.5,
    "joint_velocities": 0.6,
}


def some_state(trot):
    state = trot.state[40].copy()
    turn = Rotation.from_euler("zyx", [1.0, 0.3, -0.2])
    state[:4] = turn.as_quat(scalar_first=True)
    return state, turn


def test_errors_have_the_stated_mean_and_deviation():
    """20,000 samples: within 3 % of sigma, and of the bias by 3 sigma / sqrt(N)."""
    white = error_vector(**SIZES)
    errors = SensorErrors(bias=np.arange(36) / 10, white=white, seed=3)
    drawn = np.array([draw_error(errors, k) for k in range(20000)])
    np.testing.assert_allclose(drawn.std(axis=0), white, rtol=0.03)
    gap = np.abs(drawn.mean(axis=0) - errors.bias)
    assert (gap < 4 * white / np.sqrt(20000)).all()
    # White: neither from one sample to the next, nor between sensors, is there more
    # correlation than chance gives.
    normal = (drawn - drawn.mean(axis=0)) / drawn.std(axis=0)
    limit = 5 / np.sqrt(20000)
    assert np.abs((normal[1:] * normal[:-1]).mean(axis=0)).max() < limit
    correlation = normal.T @ normal / len(normal) - np.eye(ERROR_SIZE)
    assert np.abs(correlation).max() < limit


def test_the_same_seed_gives_the_same_errors_and_another_others():
    one, two = (
        SensorErrors(bias=np.zeros(36), white=np.ones(36), seed=seed) for seed in (1, 2)
    )
    np.testing.assert_array_equal(draw_error(one, 7), draw_error(one, 7))
    assert (draw_error(one, 7) != draw_error(one, 8)).all()
    assert (draw_error(one, 7) != draw_error(two, 7)).all()


def test_each_error_is_where_it_belongs(trot):
    state, R_WB = some_state(trot)
    error = np.random.default_rng(0).standard_normal(36)
    part, start = {}, 0
    for name, size in ERROR_LAYOUT:
        part[name] = error[start : start + size]
        start += size
    seen = measure(state, error)
    turned = R_WB * Rotation.from_rotvec(part["orientation"])
    np.testing.assert_allclose(
        Rotation.from_quat(seen[:4], scalar_first=True).as_matrix(),
        turned.as_matrix(),
        atol=1e-12,
    )
    change = seen - state
    np.testing.assert_allclose(change[4:7], part["position"])
    np.testing.assert_allclose(change[7:19], part["joint_positions"])
    np.testing.assert_allclose(
        change[19:22], R_WB.apply(part["angular_velocity"]), atol=1e-12
    )
    np.testing.assert_allclose(change[22:25], R_WB.apply(part["velocity"]), atol=1e-12)
    np.testing.assert_allclose(change[25:], part["joint_velocities"])


def test_an_encoders_error_shows_wherever_the_joint_does(go2, trot):
    """.01 rad too much: joint positions .01 more, the way to the plan .01 less."""
    ahead = preview(trot, 1.0)
    state = trot.state[50]
    seen = measure(state, error_vector(joint_positions=0.01))
    change = observe(go2, ahead, seen, np.zeros(12)) - observe(
        go2, ahead, state, np.zeros(12)
    )
    start = 0
    for name, size in OBSERVATION_LAYOUT:
        expected = {"joint_positions": 0.01, "plan_joints": -0.01}.get(name, 0.0)
        np.testing.assert_allclose(change[start : start + size], expected, atol=1e-12)
        start += size


def test_the_system_measures_with_the_error_of_its_sample(trot):
    sensors = Sensors(get_robot("go2"))
    context = sensors.CreateDefaultContext()
    state, _ = some_state(trot)
    sensors.GetInputPort("state").FixValue(context, state)
    port = sensors.GetOutputPort("state")
    np.testing.assert_array_equal(port.Eval(context), state)
    errors = SensorErrors(bias=np.zeros(36), white=np.ones(36), seed=5)
    sensors.SetDomain(context, Domain(sensors=errors))
    for time, sample in ((0.0, 0), (0.019, 0), (0.02, 1), (0.06, 3)):
        context.SetTime(time)
        expected = measure(state, draw_error(errors, sample))
        np.testing.assert_array_equal(port.Eval(context), expected)


def test_error_vectors_know_their_parts():
    assert error_vector(position=2.0).tolist() == [0.0] * 3 + [2.0] * 3 + [0.0] * 30
    with pytest.raises(TypeError, match="altitude"):
        error_vector(altitude=1.0)
