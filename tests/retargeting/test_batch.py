from dataclasses import replace

from loco_drake.datasets.segments import read_segments
from loco_drake.datasets.split import Split
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion_file import load_motion
from loco_drake.retargeting.retarget import retarget_segments


def test_one_bad_clip_does_not_stop_the_others(made_data, tmp_path):
    """The second of three files is cut off: its error is told, the others written."""
    segments = read_segments(made_data)[:2]
    whole = segments[0].path.read_text()
    bad = tmp_path / "bad.txt"
    bad.write_text(whole[:-200])
    segments.insert(1, replace(segments[0], path=bad))
    outcomes = list(retarget_segments(segments, get_robot("go2"), tmp_path / "out"))
    assert [outcome.error is None for outcome in outcomes] == [True, False, True]
    assert "cut off" in outcomes[1].error
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert written == [
        "dog-pace-made_pace-0-240.npz",
        "dog-trot-made_trot-0-240.npz",
    ]
    motion = load_motion(outcomes[2].path)
    assert str(motion.label) == "dog-trot"
    assert motion.provenance["licence"] == "CC BY-NC 4.0"
    assert motion.provenance["frames"] == "0-240"
    assert len(motion) == outcomes[2].report.frames


def test_the_side_of_the_split_goes_into_the_file(made_data, tmp_path):
    """Two files of a pace: one of them is for validation, and its motion says so."""
    first = read_segments(made_data)[0]
    copy = tmp_path / "copy.txt"
    copy.write_text(first.path.read_text())
    segments = [first, replace(first, path=copy)]
    split = Split(segments)
    outcomes = retarget_segments(segments, get_robot("go2"), tmp_path / "out", split)
    sides = [load_motion(outcome.path).provenance["split"] for outcome in outcomes]
    assert sides == [split.side(segment) for segment in segments]
    assert sorted(sides) == ["train", "validation"]


def test_whatever_breaks_a_clip_is_told_and_breaks_no_other(made_data, tmp_path):
    """A path that is a folder is no recording, and no reason to stop."""
    segments = read_segments(made_data)[:1]
    segments.insert(0, replace(segments[0], path=tmp_path))
    outcomes = list(retarget_segments(segments, get_robot("go2"), tmp_path / "out"))
    assert [outcome.error is None for outcome in outcomes] == [False, True]
