from pathlib import Path

import pytest

from loco_drake.datasets.segments import Segment, one_format, read_segments
from loco_drake.datasets.split import SHARE, TRAIN, VALIDATION, Split
from loco_drake.motion.gaits import LABELS


def segment(file, gait="trot", source="dog", seconds=2.0):
    return Segment(source, Path(f"{file}.txt"), gait, 0, round(50 * seconds), 50.0)


def held(split, segments):
    return {s.recording for s in segments if split.side(s) == VALIDATION}


@pytest.mark.parametrize("seed", range(5))
def test_every_label_has_about_its_share_and_keeps_a_recording(seed):
    """Of ten equal recordings three; of two one; of a single one none."""
    segments = [segment(f"p{i}", "pace") for i in range(10)]
    segments += [segment(f"t{i}", "trot") for i in range(2)]
    segments += [segment("g", "gallop")]
    names = held(Split(segments, seed), segments)
    assert sorted(name[0] for name in names) == ["p", "p", "p", "t"]


def test_the_seed_decides_and_nothing_else():
    segments = [segment(f"p{i}", "pace") for i in range(10)]
    sides = [held(Split(segments, seed), segments) for seed in (0, 0, 1)]
    assert sides[0] == sides[1] != sides[2]
    assert held(Split(segments[::-1], 0), segments) == sides[0]


@pytest.mark.parametrize("seed", range(5))
def test_a_file_of_two_gaits_is_on_one_side_for_both(seed):
    """Either the file with both gaits is held out, or the other two are."""
    segments = [
        segment("both", "pace"),
        segment("both", "trot"),
        segment("both", "spin"),
    ]
    segments += [segment("p", "pace"), segment("t", "trot")]
    assert held(Split(segments, seed), segments) in ({"both"}, {"p", "t"})


@pytest.mark.parametrize("seed", range(5))
def test_horses_are_held_out_by_animal(seed):
    """Three horses of four recordings: one horse, with all its days, is held out."""
    names = [
        f"Horse{k}_M{day}_{gait}1_kinematics"
        for k in (1, 2, 11)
        for day in (1, 2)
        for gait in ("walk", "trot")
    ]
    segments = [segment(name, name.split("_")[2][:-1], "horse") for name in names]
    assert {s.animal for s in segments} == {"Horse1", "Horse2", "Horse11"}
    split = Split(segments, seed)
    sides = {(s.animal, split.side(s)) for s in segments}
    assert len(sides) == 3
    assert sorted(side for _, side in sides) == [TRAIN, TRAIN, VALIDATION]


def test_only_horses_have_animals_and_unknown_recordings_train():
    assert segment("Horse1_M1_walk1", source="dog").animal is None
    assert segment("Horse1_M1_walk1", source="horse").subject == "horse-Horse1"
    assert segment("dog_walk00").subject == "dog-dog_walk00"
    assert Split([]).side(segment("new")) == TRAIN


def test_provenance_tells_recording_animal_and_rate(made_data):
    clip = read_segments(made_data)[0].read()
    assert clip.provenance["recording"] == "made_pace"
    assert clip.provenance["recording_fps"] == "60"
    assert "animal" not in clip.provenance


def test_real_recordings_are_split_evenly(real_data):
    """Every label has a fifth to two fifths of its time in validation."""
    segments = one_format(read_segments(real_data))
    for seed in range(3):
        split = Split(segments, seed)
        for label in LABELS:
            own = [s for s in segments if s.label == str(label)]
            seconds = sum(s.seconds for s in own if split.side(s) == VALIDATION)
            if own:
                share = seconds / sum(s.seconds for s in own)
                assert abs(share - SHARE) <= 0.1, (str(label), share)
