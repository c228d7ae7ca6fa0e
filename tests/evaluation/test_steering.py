from dataclasses import replace

import numpy as np
import pytest

from loco_drake.control.command import ANY_COMMAND, CommandRange
from loco_drake.control.plan import PLAN_DT, plan_from_motion
from loco_drake.evaluation.steering import (
    distance_from_plan,
    reference_latency,
    rmse,
    robot_latency,
    stride_of,
    stride_velocity,
)
from loco_drake.evaluation.steering_courses import (
    axis_points,
    gait_changes,
    grid,
    steps,
)
from loco_drake.evaluation.steering_overall import overall
from loco_drake.motion.gaits import parse_label
from tests.synthetic_motion import synthetic_motion

BOX = CommandRange((-0.5, -0.3, -1.0), (2.0, 0.3, 1.0))


def test_the_stride_is_that_of_the_formula(go2):
    plan = plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 0.6, period=0.46))
    assert stride_of(go2, plan.q) == pytest.approx(0.46, abs=0.005)


def test_a_stride_averages_the_swaying_away(go2):
    plan = plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 0.6, 0.3))
    q = plan.q.copy()
    time = np.arange(len(q)) * PLAN_DT
    # A sway of 3 cm at the stride's own .5 s: .38 m/s.
    q[:, 4] += 0.03 * np.sin(2 * np.pi * time / 0.5)
    velocity = stride_velocity(go2, q)
    assert velocity.shape == (len(q), 3)
    np.testing.assert_allclose(
        velocity[20:-20].mean(axis=0), [0.6, 0.0, 0.3], atol=0.01
    )
    assert np.abs(velocity[20:-20] - [0.6, 0.0, 0.3]).max() < 0.06


def test_errors_count_both_horizontal_directions_and_every_sample():
    """Worked by hand: three samples off by (.3, .4), one by nothing, of yaw .2."""
    bad = np.tile([0.3, 0.4, 0.2], (3, 1))
    velocity, yaw_rate = rmse([bad, np.zeros((1, 3))])
    assert velocity == pytest.approx(0.5 * np.sqrt(3 / 4))
    assert yaw_rate == pytest.approx(0.2 * np.sqrt(3 / 4))


def test_a_robot_that_ignores_the_command_scores_badly(go2):
    plan = plan_from_motion(go2, synthetic_motion("dog-trot", 6.0, 0.6))
    velocity = stride_velocity(go2, plan.q)
    told, asked = (
        rmse([velocity - np.array(command)]) for command in ((0.6, 0, 0), (1.2, 0, 0.5))
    )
    assert told[0] < 0.02
    assert asked == pytest.approx((0.6, 0.5), abs=0.01)


def test_the_latency_of_the_robot_is_where_ninety_per_cent_are_covered():
    velocity = np.zeros((200, 3))
    rise = np.clip((np.arange(200) - 60) / 50, 0, 1)  # from 1.2 s to 2.2 s
    velocity[:, 0], velocity[:, 2] = 1 + rise, 0.5 * rise
    before, after = np.array([1.0, 0, 0]), np.array([2.0, 0, 0.5])
    assert robot_latency(velocity, before, after, 50) == pytest.approx(1.1)
    # Never, where it stops half of the way.
    assert robot_latency(velocity[:80], before, after, 50) is None


def test_the_latency_of_the_reference_is_that_of_the_first_sample_that_differs(trot):
    changed = 40
    other = trot.q.copy()
    other[53:, 4] += 0.01
    plans = [trot] * 45 + [replace(trot, q=other)] * 20
    assert reference_latency(plans, changed) == pytest.approx(13 * PLAN_DT)
    assert reference_latency([trot] * 65, changed) is None
    # Samples that are only added are no change.
    grown = [trot.slice(0, 100)] * 45 + [trot] * 20
    assert reference_latency(grown, changed) is None


def test_the_distance_from_the_plan_is_horizontal(trot):
    state = trot.state.copy()
    state[70, 4:7] += [0.3, 0.4, 5.0]
    assert distance_from_plan(state, trot.state) == pytest.approx(0.5)


def test_the_grid_has_five_values_of_each_axis_and_the_corners():
    points = np.array(grid(BOX))
    assert len(points) == 1 + 3 * 4 + 8
    on_axis = points[:13]
    np.testing.assert_allclose(
        sorted(set(on_axis[:, 0])), np.linspace(-0.5, 2.0, 5), atol=1e-12
    )
    for axis in range(3):
        assert len(set(np.round(on_axis[:, axis], 9))) == 5
    assert (np.abs(points[13:] - BOX.middle) == np.array(BOX.high) - BOX.middle).all()
    # An axis without width adds no point twice.
    flat = CommandRange((0.2, 0.0, -1.0), (0.8, 0.0, 1.0))
    assert len(grid(flat)) == 1 + 2 * 4 + 4


def test_axis_points_are_those_of_the_grid_without_the_corners():
    points, narrow = axis_points(BOX), CommandRange((1, 0, -1), (1, 0, 1))
    assert [p.tolist() for p in points] == [p.tolist() for p in grid(BOX)[:13]]
    turns = [point.tolist() for point in axis_points(narrow)]
    assert turns == [[1, 0, w] for w in (0, -1, -0.5, 0.5, 1)]


def test_steps_go_to_both_ends_of_speed_and_turning_and_back():
    pairs = [(a.tolist(), b.tolist()) for a, b in steps(BOX)]
    middle = [0.75, 0.0, 0.0]
    ends = [[-0.5, 0, 0], [2.0, 0, 0], [0.75, 0, -1.0], [0.75, 0, 1.0]]
    assert pairs == [p for e in ends for p in ((middle, e), (e, middle))]


def test_changes_of_gait_lead_there_and_back_at_a_pace_that_each_can():
    slow = CommandRange((0.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    walk, bound = parse_label("horse-walk").index, parse_label("mpc-bound").index
    parts = list(gait_changes("dog-trot", BOX, {walk: slow}))
    trot = parse_label("dog-trot").index
    assert [gait for gait, _ in parts] == [trot, bound, trot, walk, trot]
    speeds = [command.tolist() for _, command in parts]
    assert speeds == [[s, 0.0, 0.0] for s in (0.75, 0.75, 0.75, 0.5, 0.75)]
    assert len(list(gait_changes("dog-pace", BOX, {}))) == 7


def test_a_range_is_clipped_scaled_and_written():
    np.testing.assert_array_equal(BOX.clip(np.array([3.0, 0.1, -9])), [2.0, 0.1, -1])
    half = BOX.scaled((0.5, 0.5, 0.25))
    assert half.low == (0.13, -0.15, -0.25)  # .125 rounded inward
    assert half.high == (1.37, 0.15, 0.25)
    assert CommandRange.of_figures(BOX.figures()) == BOX
    assert BOX.figures()["forward_mps"] == [-0.5, 2.0]
    assert (np.abs(ANY_COMMAND.low) >= np.abs(BOX.low)).all()


def test_all_labels_together_weigh_their_points():
    def label(error, points, latency):
        return {
            "velocity_rmse_mps": error,
            "yaw_rate_rmse_radps": 0.0,
            "points": [None] * points,
            "latency_reference_s": latency,
            "latency_robot_s": latency,
            "gait_change_s": latency,
            "gait_change_max_s": 2 * latency,
            "distance_from_plan_max_m": latency,
            "plan_penetration_max_m": 0.0,
            "plan_slip_median_mps": 0.0,
            "stance_slip_median_mps": None,
            "fall_rate": 0.5,
            "normalized_return": 80.0,
            "stretch": 1.0,
            "plan_joint_limit_violations": 1,
        }

    figures = overall({"a": label(0.1, 3, 0.2), "b": label(0.3, 1, 0.4)})
    assert figures["velocity_rmse_mps"] == pytest.approx(np.sqrt(0.03))
    assert figures["latency_reference_s"] == 0.4
    assert figures["latency_robot_s"] == pytest.approx(0.3)
    assert figures["gait_change_s"] == pytest.approx(0.3)
    assert figures["gait_change_max_s"] == 0.8
    assert figures["stance_slip_median_mps"] is None
    assert figures["plan_joint_limit_violations"] == 2
