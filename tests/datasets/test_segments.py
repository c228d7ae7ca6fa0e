from pathlib import Path

import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.segments import (
    Segment,
    one_format,
    read_segments,
    select_segments,
)

HEADER = "dataset,file,gait,start_frame,end_frame,fps,mean_speed_mps,notes\n"


def folder_with(tmp_path, text):
    (tmp_path / "segments.csv").write_text(text)
    return tmp_path


def test_row_becomes_a_segment_and_other_datasets_are_left_out(tmp_path):
    rows = 'dog_mann,keypoints/a.txt,trot,10,70,60,1.8,"x, y"\nelse,b,trot,0,9,60,1,\n'
    (segment,) = read_segments(folder_with(tmp_path, HEADER + rows))
    assert segment.name == "dog-trot-a-10-70"
    assert segment.path == tmp_path / "dog_mann" / "keypoints" / "a.txt"
    assert segment.seconds == 1.0


def test_segment_reads_its_own_frames(made_data):
    segments = read_segments(made_data)
    assert [segment.gait for segment in segments] == ["pace", "trot", "gallop"]
    clip = segments[1].read()
    assert (len(clip), clip.gait, clip.fps) == (240, "trot", 60.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (HEADER + "dog_mann,a.txt,trot,10\n", "line 2 lacks end_frame, fps"),
        (HEADER + "dog_mann,a.txt,trot,x,70,60,1,\n", "line 2 has frames or a rate"),
        (HEADER + "dog_mann,a.txt,trot,1_0,70,60,1,\n", "line 2 has frames or a rate"),
        (HEADER + "dog_mann,a.txt,trot,1,70,6_0,1,\n", "line 2 has frames or a rate"),
        (HEADER, "lists no segments"),
        (f"{HEADER}dog_mann,a,b,1,9,60,1,\n".replace("\n", "\f"), "lists no segments"),
        (HEADER + "dog_mann,a.txt,trot,70,10,60,1,\n", "line 2 .* Frames 70 to 10"),
        (HEADER + "dog_mann,a.txt,trot,1,10,nan,1,\n", "line 2 .* 10 to 1000"),
        ("a,b\n1,2\n", "line 1 lacks dataset"),
    ],
)
def test_damaged_table_is_refused_with_the_line(tmp_path, text, reason):
    with pytest.raises(InputError, match=reason):
        read_segments(folder_with(tmp_path, text))


def test_missing_and_binary_tables_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"lacks segments\.csv"):
        read_segments(tmp_path)
    (tmp_path / "segments.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match=r"lacks dataset|not plain text"):
        read_segments(tmp_path)


def test_selection_by_source_and_gait(made_data):
    segments = read_segments(made_data)
    assert select_segments(segments, None, ()) == segments
    assert select_segments(segments, "dog", ["trot"]) == segments[1:2]
    with pytest.raises(InputError, match="the choices are pace, trot, gallop"):
        select_segments(segments, "dog", ["trot", "fly"])
    with pytest.raises(InputError, match="no stretch of horse"):
        select_segments(segments, "horse", ())


def test_real_table_lists_the_dog_gaits(real_data):
    gaits = {segment.gait for segment in read_segments(real_data)}
    assert {"pace", "trot", "gallop"} <= gaits


def test_a_recording_in_two_formats_counts_once():
    """The .csv of two files is kept; a recording with a .txt alone keeps that."""
    files = ["a/Horse1_M1_walk1.txt", "b/Horse1_M1_walk1.csv", "a/Horse2_M1_walk1.txt"]
    segments = [Segment("horse", Path(f), "walk", 0, 600, 60.0) for f in files]
    assert len({segment.name for segment in segments}) == 3
    assert one_format(segments) == segments[1:]
