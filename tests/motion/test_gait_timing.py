import csv
import re

import numpy as np
import pytest

from loco_drake.datasets.segments import read_segments
from loco_drake.models.robots import get_robot
from loco_drake.motion.gait_timing import (
    Track,
    clip_track,
    duty_factors,
    gait_timing,
    motion_track,
    phase_lags,
    stride_period,
)
from loco_drake.motion.keypoints import KeypointClip
from tests.synthetic import GAITS, STANCE_HEIGHT, make_dog
from tests.synthetic_motion import PHASES, synthetic_motion

FPS = 50.0
LAGS = np.array([0.37, 0.9, 0.0, 0.55])


def swinging(period, seconds=4.0, heading=0.0, overtone=0.0, speed=0.7):
    """Toes that swing as cosines of 8 cm (and an overtone) under a moving trunk."""
    time = np.arange(round(seconds * FPS)) / FPS
    ahead = np.array([np.cos(heading), np.sin(heading)])
    trunk = speed * time[:, None] * ahead
    cycle = 2 * np.pi * (time[:, None] / period - LAGS)
    fore_aft = 0.08 * np.cos(cycle) + overtone * np.cos(2 * cycle + 1.0)
    soles = np.zeros((len(time), 4, 3))
    soles[..., :2] = trunk[:, None] + fore_aft[..., None] * ahead
    return Track(FPS, trunk, np.full(len(time), heading), soles, 0.3)


@pytest.mark.parametrize("period", [0.4, 0.473, 0.512, 0.777])
def test_period_and_lags_of_cosines_between_frames(period):
    """The period is told to a fiftieth of a frame, whatever the heading."""
    track = swinging(period, heading=2.1, overtone=0.03)
    assert stride_period(track) == pytest.approx(period, abs=0.0004)
    lag = phase_lags(track, period) - LAGS
    assert np.abs((lag + 0.5) % 1 - 0.5).max() < 1e-9


def test_a_clip_of_less_than_three_strides_has_no_timing():
    assert gait_timing(swinging(0.9, seconds=2.8)) is not None
    assert gait_timing(swinging(0.9, seconds=2.5)) is None
    assert gait_timing(swinging(0.9, seconds=0.1)) is None


def test_without_a_rhythm_there_is_no_period():
    still = swinging(0.5, speed=0.0)
    still.soles[:] = still.soles[0]
    assert stride_period(still) is None
    noise = swinging(0.5)
    noise.soles[:] = np.random.default_rng(0).normal(size=noise.soles.shape)
    assert stride_period(noise) is None


def test_duty_factor_by_hand():
    """Nine strides of .4 s, 20 frames; the trunk moves at 1 m/s, stance height .3 m.

    FL stands for 12 steps of 20 ms in each stride, and then swings; FR never leaves the
    ground but skates along with the trunk; RL stands still at 2 cm, which is too high;
    RR stands at 1.5 cm, which is not.
    """
    frames = 200
    stands = np.arange(1, frames) % 20 < 12
    x = np.concatenate(([0.0], np.cumsum(np.where(stands, 0.0, 1 / FPS / 0.4))))
    soles = np.zeros((frames, 4, 3))
    soles[:, 0, 0] = x
    soles[:, 1, 0] = np.arange(frames) / FPS
    soles[:, 2, 2], soles[:, 3, 2] = 0.02, 0.015
    trunk = np.stack((np.arange(frames) / FPS, np.zeros(frames)), axis=-1)
    track = Track(FPS, trunk, np.zeros(frames), soles, 0.3)
    np.testing.assert_allclose(duty_factors(track, 0.4), [108 / 180, 0, 0, 1])


@pytest.mark.parametrize("gait", GAITS)
def test_timing_of_a_made_dog(gait):
    """What it was made with; soft landings make the duty factor higher."""
    dog = make_dog(gait)
    clip = KeypointClip("dog", gait, 60.0, dog.withers, dog.hip, dog.toes, {})
    timing = gait_timing(clip_track(clip, STANCE_HEIGHT))
    assert timing.stride_period == pytest.approx(dog.gait.period, abs=0.001)
    lag = timing.phase_lags - dog.gait.phase
    assert np.abs((lag + 0.5) % 1 - 0.5).max() < 0.005
    excess = timing.duty_factors - dog.gait.duty
    assert (excess > -0.01).all()
    assert (excess < 0.2).all()


def test_timing_is_the_same_in_another_unit_of_length_and_place():
    dog = make_dog("trot")
    timings = []
    for scale in (1.0, 3.7):
        points = (scale * dog.withers, scale * dog.hip, scale * dog.toes)
        clip = KeypointClip("dog", "trot", 60.0, *points, {})
        timings.append(gait_timing(clip_track(clip, scale * STANCE_HEIGHT)))
    assert timings[0].stride_period == pytest.approx(timings[1].stride_period)
    lag = timings[0].phase_lags - timings[1].phase_lags
    assert np.abs((lag + 0.5) % 1 - 0.5).max() < 1e-9
    np.testing.assert_allclose(timings[0].duty_factors, timings[1].duty_factors)


@pytest.mark.parametrize("gait", ["trot", "pace"])
def test_timing_of_a_robot_that_turns(gait):
    motion = synthetic_motion(f"dog-{gait}", turn=0.6, period=0.45)
    timing = gait_timing(motion_track(motion, get_robot("go2")))
    assert timing.stride_period == pytest.approx(0.45, abs=0.002)
    lag = timing.phase_lags - PHASES[gait]
    assert np.abs((lag + 0.5) % 1 - 0.5).max() < 0.01
    np.testing.assert_allclose(timing.duty_factors, 0.5, atol=0.05)


def test_every_other_stride_longer_is_a_rhythm_of_two():
    """Strides of .34 and .4 s in turn repeat each .74 s: three of those take 2.2 s."""
    seconds = {2.6: 0.74, 2.0: None}
    for length, period in seconds.items():
        track = swinging(0.37, seconds=length)
        time = np.arange(len(track.soles)) / FPS
        phase = time / 0.74 + 0.04 * np.sin(2 * np.pi * time / 0.74)
        fore_aft = 0.08 * np.cos(4 * np.pi * (phase[:, None] - LAGS / 2))
        fore_aft += 0.03 * np.cos(2 * np.pi * phase)[:, None]
        track.soles[..., 0] = track.trunk[:, :1] + fore_aft
        found = stride_period(track)
        assert found == (period and pytest.approx(period, abs=0.005))


def test_rhythm_of_real_recordings_is_what_their_list_says(real_data):
    """Period and lags were noted, to .01, by whoever made segments.csv."""
    with (real_data / "segments.csv").open() as file:
        notes = [row["notes"] for row in csv.DictReader(file)]
    pattern = re.compile(r"period ([.\d]+)s lag FL/FR/RL/RR ([./\d]+) yaw \S+rad")
    checked = 0
    for segment, note in zip(read_segments(real_data), notes, strict=True):
        found = pattern.match(note)
        if found is None or segment.source != "dog" or segment.gait == "gallop":
            continue
        timing = gait_timing(clip_track(segment.read(), STANCE_HEIGHT))
        if timing is not None:
            lag = timing.phase_lags - np.array(found[2].split("/"), dtype=float)
            assert timing.stride_period == pytest.approx(float(found[1]), abs=0.02)
            assert np.abs((lag + 0.5) % 1 - 0.5).max() < 0.025
            checked += 1
    assert checked > 20
