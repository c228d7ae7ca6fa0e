from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.generation import features as ft
from loco_drake.generation.training_motions import motion_clip
from loco_drake.generation.windows import EXACT, WINDOW, PairedWindows
from loco_drake.motion.gaits import parse_label
from tests.synthetic_motion import synthetic_motion

ROBOTS = ("a1", "go2")


def clip(robot="go2", file="one.txt", mirrored=False, **gait):
    motion = synthetic_motion(name=robot, **gait)
    origin = {"file": file, "frames": "0-150"} if file else {}
    motion = replace(motion, provenance={**motion.provenance, **origin})
    return motion_clip(motion.mirrored() if mirrored else motion)


@pytest.fixture(scope="module")
def clips():
    """A trot of both robots, its mirror images, and one that only the Go2 does."""
    pairs = [clip(r, mirrored=m, turn=0.3) for r in ROBOTS for m in (False, True)]
    return [*pairs, clip("go2", "two.txt", speed=0.4)]


def test_the_second_half_is_what_another_robot_does_then(clips):
    windows = PairedWindows(clips, ROBOTS)
    frames, robot, label = windows(np.random.default_rng(0), 40)
    assert frames.shape == (80, WINDOW, ft.SIZE)
    assert set(label.tolist()) == {parse_label("dog-trot").index}
    one, other = frames.chunk(2)
    robot_one, robot_other = robot.chunk(2)
    alone = torch.isclose(one[:, :, 0].mean(dim=1), torch.tensor(0.4 / 0.3), atol=0.2)
    assert (robot_one[~alone] != robot_other[~alone]).all()
    assert (robot_one[alone] == robot_other[alone]).all()
    assert 0 < alone.sum() < 40
    # Both turn the same way, and put the same feet down at the same time.
    torch.testing.assert_close(
        one[:, 2:-2, ft.YAW_RATE], other[:, 2:-2, ft.YAW_RATE], atol=1e-2, rtol=0
    )
    assert torch.equal(one[..., ft.CONTACTS], other[..., ft.CONTACTS])
    joints = (one - other)[~alone][..., ft.JOINTS]
    assert joints.abs().max() > 0.05  # legs of another length


def test_one_robot_has_no_other_half(clips):
    alone = [c for c in clips if c.robot == "go2"]
    frames, robot, _ = PairedWindows(alone, ROBOTS)(np.random.default_rng(0), 8)
    assert len(frames) == 8
    assert robot.tolist() == [1] * 8


def test_clips_of_which_nothing_is_known_are_not_paired():
    """Without a recording's name no one can tell that they are the same."""
    unknown = [clip(robot, file="") for robot in ROBOTS]
    frames, *_ = PairedWindows(unknown, ROBOTS)(np.random.default_rng(0), 8)
    assert len(frames) == 8


def test_half_of_the_windows_are_frames_as_they_are(clips):
    """The others lie between frames, or are played faster or slower."""
    single = clips[-1]
    frames, *_ = PairedWindows([single], ROBOTS)(np.random.default_rng(0), 200)
    rows = {row.tobytes() for row in single.features.astype(np.float32)}
    exact = [all(f.numpy().tobytes() in rows for f in window) for window in frames]
    assert np.mean(exact) == pytest.approx(EXACT, abs=0.1)
