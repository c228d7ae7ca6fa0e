from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.retargeting import NO_RHYTHM, gait_fidelity, timing_errors
from loco_drake.models.robots import get_robot
from loco_drake.motion.gait_timing import (
    GaitTiming,
    Track,
    clip_track,
    gait_timing,
    motion_track,
)
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.retarget import retarget_clip
from tests.synthetic import STANCE_HEIGHT, make_dog

GO2 = get_robot("go2")


def timing(period=0.5, lags=(0.5, 0.0, 0.0, 0.5), duty=(0.5, 0.5, 0.5, 0.5)):
    return GaitTiming(period, np.array(lags), np.array(duty))


def test_errors_by_hand():
    """10 % slower; FL .02 late and RR .03 early: .05 apart; duty off by .1 and .2."""
    robot = timing(0.55, (0.52, 0.0, 0.0, 0.47), (0.6, 0.5, 0.5, 0.3))
    fidelity = timing_errors(timing(), robot)
    assert fidelity.stride_period_error == pytest.approx(0.1)
    assert fidelity.phase_lag_error == pytest.approx(0.05)
    assert fidelity.duty_factor_error == pytest.approx(0.075)


def test_lags_are_compared_around_the_circle():
    fidelity = timing_errors(timing(lags=(0, 0.01, 0, 0)), timing(lags=(0, 0.99, 0, 0)))
    assert fidelity.phase_lag_error == pytest.approx(0.02)


def test_a_reference_toe_that_is_late_is_one_error():
    """RL late by .1 makes the lags behind it .1 less, all three."""
    fidelity = timing_errors(timing(), timing(lags=(0.4, 0.9, 0.0, 0.4)))
    assert fidelity.phase_lag_error == pytest.approx(0.1)


@pytest.fixture(scope="module")
def trot():
    """Track of a made dog's trot, and that of a Go2 that was retargeted to it."""
    dog = make_dog("trot")
    clip = KeypointClip("dog", "trot", 60.0, dog.withers, dog.hip, dog.toes, {})
    motion, _ = retarget_clip(clip, GO2)
    return clip_track(clip, STANCE_HEIGHT), motion_track(motion, GO2)


def errors(source, track):
    fidelity = gait_fidelity(source, track)
    return (
        fidelity.stride_period_error,
        fidelity.phase_lag_error,
        fidelity.duty_factor_error,
    )


def test_a_good_retarget_scores_well(trot):
    period, lag, duty = errors(*trot)
    assert period < 0.005
    assert lag < 0.01
    assert duty < 0.06


def test_a_motion_played_slower_scores_badly(trot):
    """The same frames at 40 a second instead of 50: a period 25 % too long."""
    source, track = trot
    assert errors(source, replace(track, fps=40.0))[0] == pytest.approx(0.25, abs=0.005)


def test_a_shifted_foot_scores_badly(trot):
    """FR two frames, .04 s of .48 s, behind where it belongs: a twelfth of a stride."""
    source, track = trot
    feet = track.soles - np.pad(track.trunk, ((0, 0), (0, 1)))[:, None]
    shifted = track.soles[2:].copy()
    shifted[:, 1] += feet[:-2, 1] - feet[2:, 1]
    late = Track(
        track.fps, track.trunk[2:], track.yaw[2:], shifted, track.stance_height
    )
    assert errors(source, late)[1] == pytest.approx(1 / 12, abs=0.01)


def test_skating_and_floating_score_badly(trot):
    """No toe of either ever stands: the duty factor is off by all of it."""
    source, track = trot
    own = gait_timing(source).duty_factors.mean()
    floating = replace(track, soles=track.soles + np.array([0, 0, 0.03]))
    assert errors(source, floating)[2] == pytest.approx(own)
    # The trunk glides 1.8 m/s faster than the toes push it.
    glide = np.arange(len(track.trunk))[:, None] / track.fps * [1.8, 0.0]
    skating = replace(
        track,
        trunk=track.trunk + glide,
        soles=track.soles + np.pad(glide, ((0, 0), (0, 1)))[:, None],
    )
    assert errors(source, skating)[2] > 0.8 * own


def test_a_robot_that_stands_still_scores_worst(trot):
    source, track = trot
    still = replace(track, soles=np.repeat(track.soles[:1], len(track.soles), axis=0))
    still = replace(still, trunk=np.zeros_like(track.trunk), yaw=0 * track.yaw)
    assert gait_fidelity(source, still) is NO_RHYTHM
    assert errors(source, still) == (1.0, 0.5, 1.0)


def test_the_animal_decides_whether_there_are_three_strides(trot):
    """Of .48 s: 1.5 s are enough, also for a robot that ends just before; 1.3 s not."""
    source, robot = trot

    def cut(track, seconds):
        frames = round(seconds * track.fps)
        parts = (track.trunk[:frames], track.yaw[:frames], track.soles[:frames])
        return Track(track.fps, *parts, track.stance_height)

    short = gait_fidelity(cut(source, 1.5), cut(robot, 1.42))
    assert short.stride_period_error < 0.02
    assert gait_fidelity(cut(source, 1.3), robot) is None
