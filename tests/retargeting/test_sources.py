"""Made and real recordings of every source become good motion of both robots."""

import numpy as np
import pytest

from loco_drake.common.runs import intervals
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.segments import read_segments
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.contacts import detect_contacts, stance_height
from loco_drake.retargeting.inspection import summarize
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import load_config
from tests.retargeting.test_retarget import assert_good
from tests.synthetic_horse import GAITS, make_horse, write_world_recording
from tests.synthetic_robots import (
    MPC_GAITS,
    SOLO8_GAIT,
    write_mpc_recording,
    write_solo8_recording,
)

CASES = [
    *(("horse", gait) for gait in GAITS),
    *(("mpc", gait) for gait in MPC_GAITS),
    ("solo8", "walk"),
]


def made_clip(folder, source, gait):
    """Returns the clip of a made recording, its gait and its true contacts."""
    path = folder / "recording.txt"
    if source == "horse":
        horse = make_horse(gait, 120.0, 4.0)
        write_world_recording(path, horse)
        made, truth = horse.gait, horse.contacts
    elif source == "mpc":
        made = MPC_GAITS[gait]
        truth = write_mpc_recording(path, gait).contacts
    else:
        made = SOLO8_GAIT
        truth = write_solo8_recording(path).contacts[20:]
    return read_clip(source, path, gait=gait), made, truth


def touchdown_lags(contacts):
    """Returns each toe's touchdown after RL's as a share of RL's mean stride."""
    landings = [
        np.array([start for start, _ in intervals(column) if start > 0])
        for column in contacts.T
    ]
    reference = landings[2]
    period = np.diff(reference).mean()
    lags = []
    for times in landings:
        turns = np.exp(2j * np.pi * (times[:, None] - reference) / period)
        nearest = np.abs(times[:, None] - reference).argmin(axis=1)
        mean = turns[np.arange(len(times)), nearest].mean()
        lags.append(np.angle(mean) / (2 * np.pi))
    return lags


@pytest.mark.parametrize(("source", "gait"), CASES)
def test_contacts_are_those_of_the_gait(tmp_path, source, gait):
    """Duty factor, touchdown order and stride period that the feet were made with.

    Swings begin and end gently: a toe counts as landed up to 35 ms before and after it
    is quite still. Of a pace's five frames of stance the first or last may be missed.
    """
    clip, made, truth = made_clip(tmp_path, source, gait)
    config = load_config(source)
    found = detect_contacts(clip, stance_height(clip, config), config.contact)
    assert found[truth].mean() > (0.78 if gait == "pace" else 0.95)
    assert found.mean() - truth.mean() < 0.07 / made.period
    summary, _ = summarize(clip)
    assert summary.stride_period_s == pytest.approx(made.period, rel=0.02)
    lag = np.array(summary.phase) - (np.array(made.phase) - made.phase[2])
    assert np.abs((lag + 0.5) % 1 - 0.5).max() < 0.05


@pytest.mark.parametrize(("source", "gait"), CASES)
def test_made_recording_becomes_good_motion(tmp_path, robot, solver, source, gait):
    clip, made, _ = made_clip(tmp_path, source, gait)
    motion, report = retarget_clip(clip, robot, solver=solver)
    assert_good(report)
    speed = report.scale * made.speed
    way = motion.base_position[-1] - motion.base_position[0]
    assert way[0] * FPS / (len(motion) - 1) == pytest.approx(speed, rel=0.02)
    # Legs hang straight down under their hips on average.
    assert np.abs(motion.joint_positions[:, 0::3]).mean() < 0.15


def test_body_that_creeps_is_scaled_as_the_same_body_that_stands_tall(robot):
    """Solo8 at half its height becomes a robot at half of its own."""
    config = load_config("solo8")
    assert config.stance_height is not None
    legs = 2 * 0.16
    bent = (robot.stand_height - robot.foot_radius) / (
        robot.thigh_length + robot.calf_length
    )
    assert config.stance_height == pytest.approx(bent * legs + 0.0155, rel=0.08)


def test_real_recordings_of_all_labels_meet_the_numbers(real_data, robot, solver):
    """A few of each of the fifteen labels; knees and trunk clear the ground too."""
    segments = read_segments(real_data)
    for label in LABELS:
        own = [s for s in segments if (s.source, s.gait) == (label.source, label.gait)]
        for segment in own[:: max(1, len(own) // 3)]:
            motion, report = retarget_clip(segment.read(), robot, solver=solver)
            assert_good(report)
            thighs = motion.joint_positions[:, 1::3]
            assert np.abs(motion.joint_positions[:, 0::3]).max() < 0.8, segment.name
            assert thighs.max() < robot.joint_upper[1]
            assert motion.base_position[:, 2].min() > 0.1


def test_real_gaits_have_their_documented_footfall(real_data):
    """Touchdown after RL as a share of the stride, and the duty factor's side of .5."""
    expected = {
        "Horse5_M1_trot1_kinematics": ((0.45, 0.95, 0.0, 0.5), False),
        "Horse2_M1_walk1_kinematics": ((0.24, 0.74, 0.0, 0.5), True),
        "bound_0.8_0.8_50": ((0.48, 0.48, 0.0, 0.0), False),
        "gallop_1.5_1_50": ((0.43, 0.65, 0.0, 0.22), False),
        "crawl_0.5_0.5_50": ((0.5, 0.75, 0.0, 0.25), True),
        "trot_1_1_50": ((0.5, 0.0, 0.0, 0.5), True),
        "motion_data_1001": ((0.1, 0.14, 0.0, 0.16), False),
        "motion_data_1007": ((0.36, 0.74, 0.0, 0.34), True),
    }
    found = {
        s.path.stem: s for s in read_segments(real_data) if s.path.suffix == ".txt"
    }
    for stem, (phase, long) in expected.items():
        clip = found[stem].read()
        config = load_config(clip.source)
        height = stance_height(clip, config)
        contacts = detect_contacts(clip, height, config.contact)
        off = np.array(touchdown_lags(contacts)) - phase
        assert np.abs((off + 0.5) % 1 - 0.5).max() < 0.08, (stem, off)
        assert (contacts.mean() > 0.5) == long, (stem, contacts.mean(axis=0))
