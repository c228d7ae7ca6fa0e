import numpy as np
import pytest

from loco_drake.control.driving import OrderTable
from loco_drake.control.plan import PLAN_DT, plan_from_motion
from loco_drake.evaluation.drive_scores import drive_scores
from loco_drake.evaluation.driving import Driven
from loco_drake.evaluation.tracking import Rollout
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def state(go2):
    """Twelve seconds at .6 m/s and .3 rad/s."""
    return plan_from_motion(go2, synthetic_motion("dog-trot", 12.0, 0.6, 0.3)).state


def driven(state, rows, lying=(), latencies=()):
    """A drive with these states; rows are time, command, gait and reset."""
    table = np.array(
        [[t, *command, gait, 0, reset] for t, command, gait, reset in rows]
    )
    n = len(state) - 1
    zeros = np.zeros(n + 1)
    rollout = Rollout(state, state, zeros, np.zeros((n + 1, 12)), zeros, n, False)
    return Driven(
        rollout,
        OrderTable(table[:, 0], table[:, 1:]),
        len(lying) > 0,
        np.array(lying, dtype=np.int64),
        np.array([table[table[:, 0] <= PLAN_DT * k, 4][-1] for k in range(n)], int),
        list(latencies),
        1.0,
    )


def test_errors_are_those_from_the_command_in_force(go2, state):
    """Half the time .3 m/s too slow, half the time .4 m/s sideways and .2 rad/s off."""
    rows = [(0.0, (0.9, 0, 0.3), 1, 0), (6.0, (0.6, 0.4, 0.5), 1, 0)]
    scores = drive_scores(go2, driven(state, rows))
    expected = np.sqrt((0.3**2 + 0.4**2) / 2)
    assert scores["velocity_rmse_mps"] == pytest.approx(expected, abs=0.01)
    assert scores["yaw_rate_rmse_radps"] == pytest.approx(0.2 / np.sqrt(2), abs=0.01)


def test_neither_lying_nor_being_put_upright_counts(go2, state):
    jump = state.copy()
    jump[302:, 4:6] += 5.0  # m, after the control period that began at 6 s
    jump[200:302, 4:6] = jump[200, 4:6]
    rows = [(0.0, (0.6, 0, 0.3), 1, 0), (6.0, (0.6, 0, 0.3), 1, 1)]
    scores = drive_scores(go2, driven(jump, rows, lying=range(190, 302)))
    assert scores["velocity_rmse_mps"] < 0.05
    assert scores["yaw_rate_rmse_radps"] < 0.05
    # It would be much, otherwise.
    assert drive_scores(go2, driven(jump, rows))["velocity_rmse_mps"] > 0.2
    assert drive_scores(go2, driven(jump, rows[:1]))["velocity_rmse_mps"] > 0.6


def test_a_change_of_gait_ends_a_piece(go2, state):
    """Each piece has its own stride, so its ends are averaged on their own."""
    one = [(0.0, (0.6, 0, 0.3), 1, 0)]
    other = [*one, (3.0, (0.6, 0, 0.3), 0, 0)]
    whole, parts = (drive_scores(go2, driven(state, rows)) for rows in (one, other))
    assert whole["velocity_rmse_mps"] != parts["velocity_rmse_mps"]
    assert parts["velocity_rmse_mps"] < 0.03


@pytest.fixture(scope="module")
def faster(go2, state):
    """The same, with a forward velocity that rises by 1 m/s from 4 to 5 s."""
    time = PLAN_DT * np.arange(len(state))
    gain = np.interp(time, [4.0, 5.0], [0.0, 1.0])
    q, (w, x, y, z) = state.copy(), state[:, :4].T
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    for column, direction in ((4, np.cos(yaw)), (5, np.sin(yaw))):
        q[:, column] += np.cumsum(gain * direction) * PLAN_DT
    return q


def test_the_latency_of_the_robot_is_that_of_steps_that_last(go2, faster):
    slow, fast = (0.6, 0.0, 0.3), (1.6, 0.0, 0.3)
    rows = [(0.0, slow, 1, 0), (4.0, fast, 1, 0)]
    # 90 % of the velocity are there .9 s after the step.
    scores = drive_scores(go2, driven(faster, rows))
    assert scores["latency_robot_s"] == pytest.approx(0.9, abs=0.06)
    # As many small steps it is the same, from the first of them.
    many = [(4.0 + 0.1 * k, (0.6 + 0.1 * k, 0, 0.3), 1, 0) for k in range(1, 11)]
    scores = drive_scores(go2, driven(faster, [rows[0], *many]))
    assert scores["latency_robot_s"] == pytest.approx(0.8, abs=0.06)
    # One that is over at once does not count, nor does one that is small, nor one
    # with a fall.
    back = (4.5, slow, 1, 0)
    assert drive_scores(go2, driven(faster, [*rows, back]))["latency_robot_s"] is None
    small = [rows[0], (4.0, (0.7, 0, 0.3), 1, 0)]
    assert drive_scores(go2, driven(faster, small))["latency_robot_s"] is None
    fall = driven(faster, rows, lying=[280])
    assert drive_scores(go2, fall)["latency_robot_s"] is None


def test_the_latency_of_the_reference_is_the_largest(go2, state):
    rows = [(0.0, (0.6, 0, 0.3), 1, 0)]
    scores = drive_scores(go2, driven(state, rows, latencies=(0.2, 0.28, 0.24)))
    assert scores["latency_reference_s"] == 0.28
    assert drive_scores(go2, driven(state, rows))["latency_reference_s"] is None


def test_the_shortest_drive_has_scores_and_one_that_only_lies_has_none(go2, state):
    rows = [(0.0, (0.6, 0, 0.3), 1, 0)]
    assert drive_scores(go2, driven(state[:2], rows))["velocity_rmse_mps"] < 1.0
    lying = drive_scores(go2, driven(state[:9], rows, lying=range(9)))
    assert set(lying.values()) == {None}
