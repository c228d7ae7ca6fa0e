from collections import Counter
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.split import TRAIN, VALIDATION
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion_file import load_motion, save_motion
from loco_drake.retargeting.trajectories import (
    Stretch,
    choose_windows,
    trajectories,
    write_trajectories,
)
from tests.synthetic_motion import synthetic_motion


def stretch(file, start=0.0, frames=100, side=TRAIN, gait="trot", subject=None):
    return Stretch(
        path=Path(f"{gait}-{file}-{start}.npz"),
        label=GaitLabel("dog", gait),
        recording=file,
        subject=subject or file,
        side=side,
        start=start,
        frames=frames,
    )


def test_a_motion_of_five_seconds_holds_two_trajectories_in_its_middle():
    """Of 251 frames the first 25 and the last 26 are left over.

    The recording's frames, at 60 Hz from 300 on: 25 / 50 s later is frame 330.
    """
    motion = synthetic_motion("dog-trot", 5.0)
    origin = {"frames": "300-601", "recording_fps": "60", "split": "train"}
    motion = replace(motion, provenance=origin)
    first, second = trajectories(motion)
    assert len(first) == len(second) == 100
    both = np.concatenate((first.joint_positions, second.joint_positions))
    np.testing.assert_array_equal(both, motion.joint_positions[25:225])
    assert first.provenance == {**origin, "frames": "330-450"}
    assert second.provenance["frames"] == "450-570"
    assert trajectories(synthetic_motion("dog-trot", 1.0)) == []
    assert len(trajectories(motion, seconds=1.0)) == 5
    with pytest.raises(InputError, match="fewer than two frames"):
        trajectories(motion, seconds=0.0)


def test_frames_of_a_motion_in_its_own_time_are_those_of_the_recording():
    """It lasts .5 times as long: 25 frames at 50 Hz are 1 s, 60 of the recording.

    The last frame, 99 frames later, is 99 / 25 s or 237.6 frames after the first.
    """
    motion = synthetic_motion("dog-trot", 5.0)
    origin = {"frames": "300-901", "recording_fps": "60", "time_scale": "0.5"}
    first, second = trajectories(replace(motion, provenance=origin))
    assert first.provenance["frames"] == "360-599"
    assert second.provenance["frames"] == "600-839"


def test_overlap_is_judged_in_the_time_of_the_recording():
    """Both 4 s of a recording, 100 frames at twice its pace; one starts 3 s later.

    In the motion's time they would be apart, 0 to 2 s and 3 to 5 s.
    """
    stretches = [replace(stretch("r", start=s), rate=25.0) for s in (0.0, 3.0)]
    assert len(choose_windows(stretches, 4)) == 1
    assert choose_windows(stretches[:1], 1)[0].interval == (0.0, 4.0)
    assert len(choose_windows([stretch("r"), stretch("r", start=3.0)], 4)) == 2


def test_the_middle_of_each_stretch_comes_first():
    windows = choose_windows([stretch(f"r{i}", frames=330) for i in range(4)], 4)
    assert [w.start for w in windows] == [115] * 4


def test_scarce_stretches_are_cut_as_often_as_they_hold():
    """330 frames hold three windows, 199 one, 99 none."""
    short = [
        stretch("a", frames=330),
        stretch("b", frames=199),
        stretch("c", frames=99),
    ]
    windows = choose_windows(short, 10)
    found = sorted((w.stretch.recording, w.start) for w in windows)
    assert found == [("a", 15), ("a", 115), ("a", 215), ("b", 49)]


def test_windows_never_overlap_even_where_stretches_do():
    """Gallop and pace of one file overlap, and so do two stretches of the pace."""
    stretches = [
        stretch("a", 0.0, 250),
        stretch("a", 3.01, 420),
        stretch("a", 4.0, 150, gait="gallop"),
        stretch("b", 4.0, 150),
    ]
    for seed in range(5):
        windows = choose_windows(stretches, 10, seed)
        assert Counter(w.stretch.label.gait for w in windows) == {
            "trot": 5,
            "gallop": 1,
        }
        for one, two in combinations(windows, 2):
            if one.stretch.recording == two.stretch.recording:
                (a, b), (c, d) = one.interval, two.interval
                assert b <= c + 1e-9 or d <= a + 1e-9


def test_sides_are_six_to_four_and_fill_up_for_each_other():
    def sides(train, validation):
        stretches = [stretch(f"t{i}") for i in range(train)]
        stretches += [stretch(f"v{i}", side=VALIDATION) for i in range(validation)]
        count = Counter(w.stretch.side for w in choose_windows(stretches, 10))
        return count[TRAIN], count[VALIDATION]

    assert sides(20, 20) == (6, 4)
    assert sides(20, 1) == (9, 1)
    assert sides(3, 20) == (3, 7)
    assert sides(3, 2) == (3, 2)


def test_subjects_take_turns():
    """One horse with eight recordings, two with one each: all three are seen."""
    many = [stretch(f"a{i}", subject="Horse1") for i in range(8)]
    windows = choose_windows(
        [*many, stretch("b", subject="Horse2"), stretch("c", subject="Horse3")], 4
    )
    assert Counter(w.stretch.subject for w in windows) == {
        "Horse1": 2,
        "Horse2": 1,
        "Horse3": 1,
    }


def test_the_seed_decides():
    stretches = [stretch(f"r{i}") for i in range(20)]
    names = [
        [w.stretch.recording for w in choose_windows(stretches, 5, seed)]
        for seed in (0, 0, 1)
    ]
    assert names[0] == names[1] != names[2]


def test_files_of_an_earlier_larger_library_are_removed(tmp_path):
    motion = synthetic_motion("dog-trot", 5.0)
    save_motion(motion, tmp_path / "whole.npz")
    whole = replace(stretch("a", frames=251), path=tmp_path / "whole.npz")
    folder = tmp_path / "cut"
    windows = choose_windows([whole], 10)
    paths = write_trajectories(windows, folder)
    assert [path.name for path in paths] == ["dog-trot-0.npz", "dog-trot-1.npz"]
    save_motion(motion, folder / "dog-trot-mine.npz")
    write_trajectories(windows[:1], folder)
    left = sorted(path.name for path in folder.iterdir())
    assert left == ["dog-trot-0.npz", "dog-trot-mine.npz"]
    assert len(load_motion(folder / "dog-trot-0.npz")) == 100
