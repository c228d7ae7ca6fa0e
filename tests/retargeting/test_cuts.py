from collections import Counter

import pytest

from loco_drake.datasets.segments import one_format, read_segments
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.cuts import propose_cuts
from tests.synthetic import GAITS, make_dog, write_lying_dog
from tests.synthetic_animals import CAT, FAST, SCHEDULE, WALK, Gait, make_motion


def clip_of(truth, fps, provenance=None):
    return KeypointClip(
        "dog", "x", fps, truth.withers, truth.hip, truth.toes, provenance or {}
    )


def test_standing_walk_and_trot_are_cut_where_they_change():
    """Frames count from the start of the file; changes take .8 s."""
    truth = make_motion(CAT, 9.0, SCHEDULE)
    clip = clip_of(truth, CAT.fps, {"frames": "1000-1901"})
    standing, walk, trot = propose_cuts(clip)
    assert [cut.guess for cut in (standing, walk, trot)] == ["standing", "walk", "trot"]
    assert (standing.start, trot.end) == (1000, 1901)
    assert standing.end == walk.start == pytest.approx(1160, abs=60)
    assert walk.end == trot.start == pytest.approx(1460, abs=60)
    assert standing.speed_mean_mps < 0.05
    assert trot.speed_mean_mps == pytest.approx(FAST.speed, rel=0.05)
    assert trot.stride_period_s == pytest.approx(FAST.period, rel=0.02)
    assert walk.stride_period_s == pytest.approx(CAT.gait.period, rel=0.03)


@pytest.mark.parametrize("gait", GAITS)
def test_a_dog_of_one_gait_is_one_stretch(gait):
    (cut,) = propose_cuts(clip_of(make_dog(gait), 60.0))
    assert cut.guess == gait
    assert (cut.start, cut.end) == (0, 240)
    assert cut.speed_mean_mps == pytest.approx(GAITS[gait].speed, rel=1e-3)
    assert cut.stride_period_s == pytest.approx(GAITS[gait].period, rel=0.01)


@pytest.mark.parametrize(
    ("lags", "guess"),
    [
        (WALK, "walk"),
        ((0.75, 0.25, 0.0, 0.5), "walk"),  # diagonal sequence
        ((0.0, 0.5, 0.0, 0.5), "pace"),
        ((0.5, 0.0, 0.0, 0.5), "trot"),
        ((0.5, 0.5, 0.0, 0.0), "bound"),
        ((0.1, 0.3, 0.0, 0.85), "gallop"),
    ],
)
def test_lags_of_the_feet_tell_the_gait(lags, guess):
    gait = Gait(0.65, 0.6, 0.3 if guess in ("bound", "gallop") else 0.6, lags)
    truth = make_motion(CAT, 4.0, ((0.0, gait),))
    (cut,) = propose_cuts(clip_of(truth, CAT.fps))
    assert cut.guess == guess


def test_a_dog_that_lies_first_is_down(tmp_path):
    from loco_drake.datasets.registry import read_clip

    write_lying_dog(tmp_path / "a.txt")
    down, trot = propose_cuts(read_clip("dog", tmp_path / "a.txt", "x"))
    assert (down.guess, trot.guess) == ("down", "trot")
    assert down.end == trot.start == pytest.approx(240, abs=40)


def test_real_recordings_are_called_what_people_called_them(real_data):
    """At least nine tenths of the seconds of each gait of the dog and the horse."""
    segments = one_format(read_segments(real_data))
    horses = [segment for segment in segments if segment.source == "horse"]
    segments = [s for s in segments if s.source == "dog" or s in horses[::8]]
    agreed, total = Counter(), Counter()
    for segment in segments:
        wanted = segment.gait in ("pace", "trot", "gallop") or segment.source == "horse"
        if not wanted:
            continue
        for cut in propose_cuts(segment.read()):
            total[segment.label] += cut.seconds
            agreed[segment.label] += cut.seconds * (cut.guess == segment.gait)
    assert {label for label in total if agreed[label] < 0.9 * total[label]} == set()
    assert len(total) == 5
