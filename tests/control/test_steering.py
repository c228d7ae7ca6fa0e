from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import angular_velocity
from loco_drake.control.command import ANY_COMMAND, CommandRange
from loco_drake.control.ground_path import ground_pose, path_velocity
from loco_drake.control.plan import PLAN_DT, make_plan, plan_from_motion
from loco_drake.control.steering import begin, steer
from tests.synthetic_motion import synthetic_motion

COMMANDS = [
    (0.5, 0.0, 1.0),
    (0.0, 0.0, 0.0),
    (0.0, 0.3, 0.0),
    (-0.3, 0.0, 0.0),
    (0.9, -0.1, -0.6),
]


def steered(robot, plan, command, fixed=0.0, before=None):
    before = before or begin(plan)
    return steer(robot, before, plan, np.array(command), fixed, 0.6)


def stance_speeds(plan):
    """Horizontal speed of the toes between two samples in stance, m/s."""
    stands = plan.contacts[1:] & plan.contacts[:-1]
    steps = np.linalg.norm(np.diff(plan.p_WF[..., :2], axis=0), axis=-1)
    return steps[stands] / PLAN_DT


@pytest.mark.parametrize("command", COMMANDS)
def test_the_base_moves_as_commanded(go2, trot, command):
    result = steered(go2, trot, command)
    velocity = path_velocity(ground_pose(result.plan.q))[75:]
    np.testing.assert_allclose(velocity.mean(axis=0), command, atol=0.01)
    np.testing.assert_array_equal(result.command, command)


@pytest.mark.parametrize("command", COMMANDS)
def test_feet_that_stand_stay_where_they_are(go2, trot, command):
    """As still as before, to a tenth of a millimetre per second, and as high."""
    plan = steered(go2, trot, command).plan
    assert stance_speeds(plan).max() < stance_speeds(trot).max() + 2e-3
    np.testing.assert_allclose(plan.p_WF[..., 2], trot.p_WF[..., 2], atol=1e-6)
    np.testing.assert_array_equal(plan.contacts, trot.contacts)


@pytest.mark.parametrize("command", COMMANDS)
def test_nothing_jumps_and_joints_keep_their_limits(go2, trot, command):
    plan = steered(go2, trot, command).plan
    q, v = plan.q, plan.v
    assert (q[:, 7:] >= go2.joint_lower).all()
    assert (q[:, 7:] <= go2.joint_upper).all()
    assert (np.abs(v[:, 6:]) <= go2.joint_speed_limits).all()
    moving = np.gradient(q[:, 4:], PLAN_DT, axis=0)
    np.testing.assert_allclose(v[1:-1, 3:], moving[1:-1], atol=1e-9)
    turning = angular_velocity(q[:, :4], PLAN_DT)
    np.testing.assert_allclose(v[1:-1, :3], turning[1:-1], atol=1e-9)
    # Toes change their velocity hardly faster than those of a much faster trot.
    fast = plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 1.6))
    jolt, most = (
        np.abs(np.diff(p.p_WF, n=2, axis=0)).max() / PLAN_DT**2 for p in (plan, fast)
    )
    assert jolt < 1.6 * most


def test_height_roll_and_pitch_are_as_before(go2, trot):
    plan = steered(go2, trot, (0.2, 0.1, -0.7)).plan
    np.testing.assert_array_equal(plan.q[:, 6], trot.q[:, 6])

    def tilt(q):  # the world's z axis in the trunk
        w, x, y, z = q[:, :4].T
        return np.stack((2 * (x * z - w * y), 2 * (y * z + w * x)), axis=1)

    np.testing.assert_allclose(tilt(plan.q), tilt(trot.q), atol=1e-12)


def test_its_own_pace_as_command_leaves_a_plan_where_it_is(go2):
    plan = plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 0.8))
    result = steered(go2, plan, (0.8, 0.0, 0.0))
    np.testing.assert_allclose(result.plan.q, plan.q, atol=2e-3)


def test_a_faster_trot_is_the_trot_that_was_written_faster(go2):
    """Its feet and trunk follow those of the same formula with the other speed."""
    slow, fast = (
        plan_from_motion(go2, synthetic_motion("dog-trot", 6.0, speed))
        for speed in (0.6, 1.0)
    )
    result = steered(go2, slow, (1.0, 0.0, 0.0)).plan
    # In the steady second half, where it is later than the fast one by a constant.
    half = slice(150, 280)
    p_BoF = result.p_WF[half] - result.q[half, None, 4:7]
    expected = fast.p_WF[half] - fast.q[half, None, 4:7]
    stands = fast.contacts[half]
    np.testing.assert_allclose(p_BoF[stands], expected[stands], atol=6e-3)


def test_a_new_command_keeps_what_is_fixed_and_goes_on_smoothly(go2, trot):
    first = steered(go2, trot, (0.5, 0.0, 0.5))
    time = 1.31
    second = steered(go2, trot, (0.2, 0.1, -1.0), time, first)
    fixed = round(1.32 / PLAN_DT) + 1
    np.testing.assert_array_equal(second.plan.q[:fixed], first.plan.q[:fixed])
    assert (second.plan.q[fixed] != first.plan.q[fixed]).any()
    # It leaves the old plan as smoothly as its filter does.
    apart = np.abs(second.plan.q - first.plan.q)[fixed : fixed + 4]
    assert apart[0].max() < 0.01
    assert apart[3].max() < 0.1
    assert stance_speeds(second.plan).max() < stance_speeds(trot).max() + 2e-3
    velocity = path_velocity(ground_pose(second.plan.q))[-50:]
    np.testing.assert_allclose(velocity.mean(axis=0), (0.2, 0.1, -1.0), atol=0.02)


def test_steering_a_plan_piece_by_piece_is_steering_it_at_once(go2):
    """Up to what could not be known yet: the pace and the stances near its end."""
    whole = plan_from_motion(go2, synthetic_motion("dog-trot", 8.0, 0.7))
    command = (0.5, 0.1, 0.6)
    result = begin(replace(whole.slice(0, 150), open_ended=True))
    for end in (150, 200, 250, 300, 350, 401):
        fixed = max(0.0, (end - 150) * PLAN_DT)
        part = replace(whole.slice(0, end), open_ended=True)
        result = steered(go2, part, command, fixed, result)
    once = steered(go2, whole, command)
    np.testing.assert_allclose(result.plan.q, once.plan.q, atol=0.02)
    assert stance_speeds(result.plan).max() < 2e-2


def test_what_legs_cannot_do_is_followed_as_far_as_they_can(go2, trot):
    result = steered(go2, trot, (3.5, 0.0, 0.0))
    assert 0.8 < result.command[0] < 3.0
    assert stance_speeds(result.plan).max() < stance_speeds(trot).max() + 0.15
    senseless = steered(go2, trot, (1e9, -1e9, 1e9))
    assert (np.abs(senseless.command) <= ANY_COMMAND.high).all()
    assert np.isfinite(senseless.plan.q).all()


def test_a_swing_leg_that_is_folded_as_far_as_it_goes_does_not_hold_a_command_back(go2):
    """Calves reach their limits in mid-swing; a faster trot would fold them more."""
    trot = plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 0.5))
    calves = trot.q[:, 9::3]
    limit = calves.min() + 0.1 * np.ptp(calves)
    lower = np.where(np.arange(12) % 3 == 2, limit, go2.joint_lower)
    robot = replace(go2, joint_lower=lower)
    q = trot.q.copy()
    q[:, 7:] = np.maximum(q[:, 7:], lower)
    folded = make_plan(robot, q=q, v=trot.v, contacts=trot.contacts, labels=trot.labels)
    assert not (trot.contacts & (calves < limit)).any()
    result = steered(robot, folded, (0.9, 0.0, 0.3))
    np.testing.assert_array_equal(result.command, [0.9, 0.0, 0.3])
    assert (result.plan.q[:, 7:] >= lower).all()
    assert stance_speeds(result.plan).max() < stance_speeds(folded).max() + 2e-3
    assert result.plan.p_WF[..., 2].min() > folded.p_WF[..., 2].min() - 2e-3


def test_each_gait_keeps_its_own_range(go2):
    """A trot may turn; the pace after it may not, and has to go on."""
    trot = plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 0.7))
    labels = trot.labels.copy()
    labels[100:] = 0
    both = replace(trot, labels=labels)
    ranges = {
        0: CommandRange((0.5, -0.1, -0.0), (1.0, 0.1, 0.0)),
        1: CommandRange((0.0, -0.3, -1.0), (1.0, 0.3, 1.0)),
    }
    command = np.array([0.0, 0.0, 2.0])
    result = steer(go2, begin(both), both, command, 0.0, 0.4, ranges)
    velocity = path_velocity(ground_pose(result.plan.q))
    np.testing.assert_allclose(velocity[60:85].mean(axis=0), [0, 0, 1], atol=0.03)
    np.testing.assert_allclose(velocity[-50:].mean(axis=0), [0.5, 0, 0], atol=0.03)
    np.testing.assert_array_equal(result.command, [0.5, 0.0, 0.0])


def test_a_large_step_accelerates_no_faster_than_a_robot_can(go2):
    """From 1.5 m/s backwards: 3 m/s^2, where the filter alone would reach 4.8."""
    trot = plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 1.5))
    result = steered(go2, trot, (-0.5, 0.0, 0.0), fixed=1.0)
    assert np.diff(result.speed[:, 0]).min() / PLAN_DT == pytest.approx(-3.0, abs=0.02)
    assert result.speed[-1, 0] == pytest.approx(-0.5, abs=0.01)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_command_that_is_not_finite_is_refused(go2, trot, bad):
    with pytest.raises(InputError, match="three finite numbers: forward and sideways"):
        steered(go2, trot, (0.5, bad, 0.0))
