"""Mirrored motion, and motion in a robot's own time."""

from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.retargeting import gait_fidelity
from loco_drake.models.robots import get_robot
from loco_drake.motion.gait_timing import clip_track, motion_track
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.contacts import detect_contacts
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import (
    RetargetConfig,
    Variant,
    in_time,
    load_config,
    smoothing_in_time,
)
from tests.synthetic import GAITS, STANCE_HEIGHT, make_dog
from tests.synthetic_horse import make_horse
from tests.synthetic_robots import MPC_GAITS, SOLO8_GAIT, make_robot

FROUDE = Variant(froude=True)


def dog_clip(gait="trot", size=1.0):
    """A made dog's clip; ``size`` scales all lengths, not times."""
    dog = make_dog(gait)
    points = (size * dog.withers, size * dog.hip, size * dog.toes)
    return KeypointClip("dog", gait, 60.0, *points, {"file": "made.txt"})


@pytest.fixture(scope="module")
def robot():
    return get_robot("go2")


@pytest.fixture(scope="module")
def solver(robot):
    return LegSolver(robot, FPS)


def test_dog_four_times_as_high_as_the_robot_lasts_half_as_long(robot, solver):
    """239 steps of 1/60 s are 3.983 s; half of that holds 99 steps of 20 ms.

    Speed: 1.8 m/s times the size, times .25 for the lengths, over .5 for the times.
    """
    size = 4 * robot.stand_height / STANCE_HEIGHT
    clip = dog_clip(size=size)
    motion, report = retarget_clip(clip, robot, solver=solver, variant=FROUDE)
    plain, plain_report = retarget_clip(clip, robot, solver=solver)
    assert report.scale == pytest.approx(0.25)
    assert (report.time_scale, plain_report.time_scale) == (pytest.approx(0.5), 1.0)
    assert (len(motion), len(plain)) == (100, 200)
    assert float(motion.provenance["time_scale"]) == pytest.approx(0.5)
    assert plain.provenance["time_scale"] == "1"
    speed = size * GAITS["trot"].speed * 0.25
    np.testing.assert_allclose(plain.base_velocity[:, 0], speed, atol=0.01)
    np.testing.assert_allclose(motion.base_velocity[:, 0], 2 * speed, atol=0.02)

    def froude(velocity, height):
        return velocity**2 / (9.81 * height)

    own = froude(size * GAITS["trot"].speed, size * STANCE_HEIGHT)
    made = froude(motion.base_velocity[:, 0].mean(), robot.stand_height)
    assert made == pytest.approx(own, rel=0.01)
    assert report.joint_speed_ratio_max <= 1.0
    assert report.stance_slip_median_mps <= 0.03


def test_poses_are_those_of_the_slow_motion_at_twice_the_rate(robot, solver):
    """Smoothing knows the animal's clock: frame k is frame 2 k of the slow motion.

    Cut-offs left in the robot's clock would halve what is kept of each stride.
    """
    clip = dog_clip(size=4 * robot.stand_height / STANCE_HEIGHT)
    fast, _ = retarget_clip(clip, robot, solver=solver, variant=FROUDE)
    slow, _ = retarget_clip(clip, robot, solver=solver)
    off = fast.joint_positions - slow.joint_positions[::2]
    assert np.sqrt((off**2).mean()) < 0.02
    assert (fast.contacts == slow.contacts[::2]).mean() > 0.98


def test_rhythm_is_compared_in_the_time_of_the_motion(robot, solver):
    """Period .48 s of the animal, .24 s of the robot: no error; 100 % the other way."""
    clip = dog_clip(size=4 * robot.stand_height / STANCE_HEIGHT)
    motion, report = retarget_clip(clip, robot, solver=solver, variant=FROUDE)
    height = robot.stand_height / report.scale
    made = motion_track(motion, robot)
    timed = clip_track(FROUDE.apply(clip, report.scale), height)
    assert gait_fidelity(timed, made).stride_period_error < 0.01
    assert gait_fidelity(timed, made).duty_factor_error < 0.1
    plain = gait_fidelity(clip_track(clip, height), made)
    assert plain.stride_period_error == pytest.approx(0.5, abs=0.01)


def test_clock_and_cut_offs_change_and_nothing_else():
    clip, config = dog_clip(), RetargetConfig()
    slow = in_time(clip, 1.5)
    assert slow.fps == pytest.approx(40.0)
    assert (len(slow) - 1) / slow.fps == pytest.approx(1.5 * (len(clip) - 1) / 60)
    np.testing.assert_array_equal(slow.toes, clip.toes)
    changed = smoothing_in_time(config, 0.5)
    assert (changed.smoothing.base, changed.smoothing.toes) == (10.0, 14.0)
    assert replace(changed, smoothing=config.smoothing) == config
    assert smoothing_in_time(config, 1.0) == config


def test_mirrored_clip_gives_the_mirror_image_of_the_motion(robot, solver):
    """Two ways that know nothing of each other: keypoints mirrored, joints mirrored."""
    clip = dog_clip("gallop")
    motion, report = retarget_clip(clip, robot, solver=solver)
    variant = Variant(mirror=True)
    mirrored, mirrored_report = retarget_clip(
        clip, robot, solver=solver, variant=variant
    )
    assert (report.mirrored, mirrored_report.mirrored) == (False, True)
    assert "mirrored" not in motion.provenance
    assert mirrored.provenance["mirrored"] == "left-right"
    assert "mirrored" not in mirrored.mirrored().provenance
    image = motion.mirrored()
    np.testing.assert_array_equal(mirrored.contacts, motion.contacts[:, [1, 0, 3, 2]])
    for name in ("base_position", "base_quaternion", "joint_positions"):
        np.testing.assert_allclose(
            getattr(mirrored, name), getattr(image, name), atol=1e-3
        )
    assert np.abs(mirrored.joint_positions - motion.joint_positions).max() > 0.2
    assert mirrored_report.correction_rmse_m == pytest.approx(
        report.correction_rmse_m, rel=1e-3
    )


def test_clip_mirrored_swaps_legs_and_turns_y_by_hand():
    clip = dog_clip("gallop")
    clip.toes[:, 2, 1] = 0.07  # RL
    mirrored = clip.mirrored()
    np.testing.assert_array_equal(mirrored.toes[:, 3, 1], -0.07)
    np.testing.assert_array_equal(mirrored.toes[:, 0, 0], clip.toes[:, 1, 0])
    np.testing.assert_array_equal(mirrored.mirrored().toes, clip.toes)
    assert mirrored.mirrored().provenance == clip.provenance
    contacts = detect_contacts(clip, STANCE_HEIGHT, load_config("dog").contact)
    swapped = detect_contacts(mirrored, STANCE_HEIGHT, load_config("dog").contact)
    np.testing.assert_array_equal(swapped, contacts[:, [1, 0, 3, 2]])


def test_both_at_once_and_the_folder_that_tells_them(robot, solver):
    both = Variant(mirror=True, froude=True)
    assert (both.suffix, Variant().suffix) == ("-mirrored-froude", "")
    clip = dog_clip("pace")
    motion, report = retarget_clip(clip, robot, solver=solver, variant=both)
    one, _ = retarget_clip(clip, robot, solver=solver, variant=FROUDE)
    scale = np.sqrt(robot.stand_height / STANCE_HEIGHT)
    assert report.time_scale == pytest.approx(scale, rel=1e-4)
    assert set(motion.provenance) >= {"mirrored", "time_scale"}
    np.testing.assert_allclose(
        motion.joint_positions, one.mirrored().joint_positions, atol=1e-3
    )


def made_clip(label):
    """A clip of two seconds of any of the fifteen labels, by formula."""
    time = np.arange(100) / 50.0
    match label.source:
        case "dog":
            made, fps = make_dog(label.gait, 2.0), 60.0
        case "horse":
            made, fps = make_horse(label.gait, 60.0, 2.0), 60.0
        case "mpc":
            gait = MPC_GAITS.get(label.gait, MPC_GAITS["bound"])
            made, fps = make_robot(gait, time, 0.1505, 0.1, 0.062), 50.0
        case _:
            made, fps = make_robot(SOLO8_GAIT, time, 0.19, 0.15, 0.05), 50.0
    points = (made.withers, made.hip, made.toes)
    return KeypointClip(label.source, label.gait, fps, *points, {})


@pytest.mark.parametrize("label", LABELS, ids=str)
def test_every_label_can_be_mirrored_and_timed(robot, solver, label):
    """In its time, with legs swapped, within all limits and on still feet."""
    clip = made_clip(label)
    both = Variant(mirror=True, froude=True)
    motion, report = retarget_clip(clip, robot, solver=solver, variant=both)
    assert report.time_scale == pytest.approx(np.sqrt(report.scale))
    seconds = (len(clip) - 1) / clip.fps * report.time_scale
    assert motion.duration == pytest.approx(seconds, abs=1 / FPS)
    assert report.joint_limit_violations == 0
    assert report.joint_speed_ratio_max <= 1.0
    assert report.stance_slip_median_mps <= 0.03
    assert report.penetration_max_m <= 0.002
    one, _ = retarget_clip(clip, robot, solver=solver, variant=FROUDE)
    image = one.contacts[:, [1, 0, 3, 2]]
    np.testing.assert_array_equal(motion.contacts, image)
