"""Grounding: what it mends, what it leaves alone, and its derivatives."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from loco_drake.common.rotations import quat_multiply, quat_rotate
from loco_drake.motion import quality
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.momentum import (
    free_fall_error,
    mass_model,
    momentum_error,
    positions,
)
from loco_drake.motion.motion import FPS, make_motion
from loco_drake.retargeting.grounding import ground, grounding_report, linearize
from loco_drake.retargeting.least_squares import solve_least_squares
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import Variant
from tests.synthetic import make_dog

G = 9.81
PERIOD, FLIGHT = 20, 8  # frames


def hops(robot, rise, periods=3):
    """Hops in place on four feet; in the air, .16 of .4 s, the trunk rises ``rise`` m.

    The trunk follows half a sine in the air and stands still on the ground.
    """
    frames = periods * PERIOD
    phase = np.arange(frames) % PERIOD
    flies = phase < FLIGHT
    lift = np.where(flies, np.sin(np.pi * (phase + 1) / (FLIGHT + 1)), 0.0)
    base = np.zeros((frames, 3))
    base[:, 2] = robot.stand_height + rise * lift
    up = np.array([0.0, 0.0, robot.stand_height])
    stand = robot.toe_positions(robot.stand_joints) + up
    p_WF = np.repeat(stand[None], frames, axis=0)
    p_WF[..., 2] += 0.5 * rise * lift[:, None]
    return make_motion(
        robot=robot.name,
        label=GaitLabel("dog", "trot"),
        joint_names=robot.joint_names,
        base_position=base,
        base_quaternion=np.tile([1.0, 0, 0, 0], (frames, 1)),
        joint_positions=robot.nearest_joints(p_WF - base[:, None]),
        contacts=np.repeat(~flies[:, None], 4, axis=1),
        provenance={"file": "made"},
    )


@pytest.fixture(scope="module")
def hopped(robot, solver):
    made = hops(robot, 0.02)
    return made, ground(made, robot, solver)


def test_flight_becomes_the_parabola_of_its_duration(robot, hopped):
    """In each flight the centre of mass falls as g says; the toes are where they were.

    From take-off to landing, 9 steps of 20 ms, the parabola rises g (.18 s)^2 / 8 = 40
    mm over its ends, of which the made motion has fewer than half.
    """
    made, (motion, _, solved) = hopped
    assert solved.all()
    assert free_fall_error(made, robot) > 5
    assert free_fall_error(motion, robot) < 0.4
    assert momentum_error(made, robot) > 0.3
    assert momentum_error(motion, robot) < 0.02
    height = mass_model(robot).momentum(positions(motion), FPS).com[:, 2]
    first, last = PERIOD - 1, PERIOD + FLIGHT
    time = np.arange(last - first + 1) / FPS
    line = np.interp(time, time[[0, -1]], height[[first, last]])
    parabola = G * time * (time[-1] - time) / 2
    np.testing.assert_allclose(height[first : last + 1] - line, parabola, atol=1.5e-3)
    assert parabola.max() == pytest.approx(0.0393, abs=1e-3)  # 40 mm between frames
    toes = [quality.toe_trajectories(each, robot) for each in (made, motion)]
    np.testing.assert_allclose(*toes, atol=1e-4)
    np.testing.assert_array_equal(motion.contacts, made.contacts)


def test_price_is_told_and_small(robot, hopped):
    """The trunk moves by less than the parabola rises; joints stay within limits."""
    made, (motion, report, _) = hopped
    assert report == grounding_report(made, motion, robot)
    assert float(motion.provenance["momentum_error"]) == pytest.approx(
        report.momentum_error, rel=1e-5
    )
    assert 0.003 < report.base_shift_rmse_m < 0.025
    assert 0.003 < report.ground_correction_rmse_m < 0.025
    assert 0.005 < report.joint_correction_rmse_rad < 0.1
    assert report.base_turn_rmse_rad < 0.05
    assert report.momentum_error == momentum_error(motion, robot)
    assert report.momentum_error_before == momentum_error(made, robot)
    joints = motion.joint_positions
    assert quality.joint_limit_violations(joints, robot) == 0
    assert quality.joint_speed_ratio_max(joints, robot, FPS) <= 1


def test_motion_that_obeys_physics_is_left_alone(robot, solver, hopped):
    """What was grounded once moves by a third of that, at most, when grounded again."""
    made, (motion, _, _) = hopped
    again = ground(motion, robot, solver).motion
    first, second = (
        quality.distance_rmse(a.base_position, b.base_position)
        for a, b in ((made, motion), (motion, again))
    )
    assert second < 0.3 * first
    stands = hops(robot, 0.0).slice(0, 30)
    stands = replace(stands, contacts=np.ones_like(stands.contacts))
    kept = ground(stands, robot, solver).motion
    np.testing.assert_allclose(kept.base_position, stands.base_position, atol=2e-4)


def test_flight_too_long_for_its_legs_is_a_compromise_within_limits(robot, solver):
    """1 s in the air takes 1.2 m, which no leg has: toes and limits win."""
    made = hops(robot, 0.02, periods=4)
    contacts = made.contacts.copy()
    contacts[15:65] = False
    long = replace(made, contacts=contacts)
    motion, report, solved = ground(long, robot, solver)
    assert solved.all()
    assert 1 < report.free_fall_error_mps2 < report.free_fall_error_before_mps2
    assert quality.joint_limit_violations(motion.joint_positions, robot) == 0
    p_WF = quality.toe_trajectories(motion, robot)
    assert quality.penetration_max(p_WF, robot.foot_radius) < 0.002


@pytest.mark.parametrize("frames", [3, 4, 7])
def test_shortest_motions_with_and_without_contact(robot, solver, frames):
    made = hops(robot, 0.02)
    for start in (0, FLIGHT + 2):  # in the air, on the ground
        short = made.slice(start, start + frames)
        motion = ground(short, robot, solver).motion
        assert len(motion) == frames
        assert momentum_error(motion, robot) <= momentum_error(short, robot) + 1e-3


@pytest.mark.parametrize("gait", ["pace", "trot", "gallop"])
def test_made_dog_is_grounded_by_retargeting(robot, solver, gait):
    """Errors fall to a fifth, footholds stay, and the file tells the price."""
    dog = make_dog(gait, seconds=2.0)
    points = (dog.withers, dog.hip, dog.toes)
    clip = KeypointClip("dog", gait, 60.0, *points, {"file": "made.txt"})
    plain, before = retarget_clip(clip, robot, solver=solver)
    motion, report = retarget_clip(
        clip, robot, solver=solver, variant=Variant(ground=True)
    )
    told = report.grounding
    assert before.grounding is None
    assert told.momentum_error < 0.2 * told.momentum_error_before
    assert told.momentum_error_before > 0.1
    assert told.ground_correction_rmse_m < 0.025
    assert told.joint_correction_rmse_rad < 0.06
    assert report.toe_error_rmse_m < 1e-3
    assert report.stance_slip_median_mps < 1e-3
    assert report.penetration_max_m < 1e-3
    assert report.joint_limit_violations == 0
    assert report.joint_speed_ratio_max <= 1
    np.testing.assert_array_equal(motion.contacts, plain.contacts)
    kept = motion.provenance["ground_correction_rmse_m"]
    assert float(kept) == pytest.approx(told.ground_correction_rmse_m, rel=1e-5)
    assert not set(vars(told)) & set(plain.provenance)
    assert "grounding" not in report.figures
    assert json.loads(json.dumps(report.figures))["momentum_error"] > 0
    assert "momentum_error" not in before.figures
    again, _ = retarget_clip(clip, robot, solver=solver, variant=Variant(ground=True))
    np.testing.assert_array_equal(again.joint_positions, motion.joint_positions)


def test_derivatives_are_those_of_finite_differences(robot):
    """Of centre of mass, joints and knees by the trunk's pose, toes fixed."""
    made = hops(robot, 0.02).slice(0, 4)
    p_WF, q = quality.toe_trajectories(made, robot), positions(made)
    at = linearize(made, robot, q, p_WF, np.zeros((4, 4, 3)))
    size = 1e-5
    for n, step in enumerate(size * np.eye(6)):
        shifted = []
        for sign in (1, -1):
            turn = np.r_[1.0, sign * step[:3] / 2]
            trunk = q.copy()
            trunk[:, :4] = quat_multiply(turn / np.linalg.norm(turn), q[:, :4])
            trunk[:, 4:7] += sign * step[3:]
            q_BW = trunk[:, None, :4] * [1, -1, -1, -1]
            p_BF = quat_rotate(q_BW, p_WF - trunk[:, None, 4:7])
            trunk[:, 7:] = robot.leg_joints(p_BF)
            knees = quat_rotate(trunk[:, None, :4], robot.knee_positions(trunk[:, 7:]))
            com = mass_model(robot).momentum(trunk, FPS).com
            shifted.append((com, trunk[:, 7:], knees[..., 2] + trunk[:, 6:7]))
        found = [(a - b) / (2 * size) for a, b in zip(*shifted, strict=True)]
        wanted = (at.com_matrices, at.joint_matrices, at.knee_matrices)
        for one, matrices in zip(found, wanted, strict=True):
            np.testing.assert_allclose(one, matrices[..., n], atol=3e-3, rtol=3e-3)


def test_least_squares_by_hand():
    """x^2 + (x + y - 3)^2 + (y - 1)^2 has (2/3, 5/3); with x <= .5 it is (.5, 1.75)."""
    A = csc_matrix(np.array([[1.0, 0], [1, 1], [0, 1]]))
    b = np.array([0.0, 3, 1])
    G_ = csc_matrix(np.array([[1.0, 0]]))
    free = solve_least_squares(A, b, G_, np.array([10.0]))
    np.testing.assert_allclose(free, [2 / 3, 5 / 3], atol=1e-6)
    bounded = solve_least_squares(A, b, G_, np.array([0.5]))
    np.testing.assert_allclose(bounded, [0.5, 1.75], atol=1e-6)
