import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.generation import features as ft
from loco_drake.generation.clips import Clip
from loco_drake.generation.stitching import BLEND, SHORTEST_STAY, Stitcher
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label

GO2 = get_robot("go2")
TROT = parse_label("dog-trot")


@pytest.fixture
def clips(make_synthetic):
    """A slow, a turning and a fast clip, 2 s each."""
    motions = [
        make_synthetic("dog-trot", 2.0, speed, turn, phase=phase)
        for speed, turn, phase in ((0.6, 0.0, 0.0), (0.7, 0.4, 0.3), (0.8, 0.0, 0.7))
    ]
    return [Clip("go2", TROT, "r", ft.motion_features(GO2, m)) for m in motions]


def test_motions_are_as_long_as_asked_and_nowhere_jump(clips):
    """Joints move no faster between frames than within the clips."""
    stitched = Stitcher(clips)(2000, np.random.default_rng(0))
    assert stitched.shape == (2000, ft.SIZE)
    steps = [np.abs(np.diff(c.features[:, ft.JOINTS], axis=0)).max() for c in clips]
    assert np.abs(np.diff(stitched[:, ft.JOINTS], axis=0)).max() < 1.3 * max(steps)
    assert set(np.unique(stitched[:, ft.CONTACTS])) == {0.0, 1.0}


def test_the_gait_keeps_its_beat_across_transitions(clips):
    """The stride of 0.5 s stays: contacts 25 frames apart agree, 12 apart do not."""
    stitched = Stitcher(clips)(2000, np.random.default_rng(0))
    down = stitched[:, ft.CONTACTS]
    assert (down[25:] == down[:-25]).mean() > 0.85
    assert (down[12:] == down[:-12]).mean() < 0.3


def test_every_clip_is_used(clips):
    """The speeds tell the clips apart."""
    stitch, random = Stitcher(clips), np.random.default_rng(0)
    motions = np.concatenate([stitch(1000, random) for _ in range(10)])
    speed = motions[:, 0] * GO2.stand_height
    for of_clip in (0.6, 0.7, 0.8):
        assert 0.15 < (np.abs(speed - of_clip) < 0.02).mean() < 0.6


def test_the_same_dice_give_the_same_motion(clips):
    a = Stitcher(clips)(500, np.random.default_rng(5))
    b = Stitcher(clips)(500, np.random.default_rng(5))
    c = Stitcher(clips)(500, np.random.default_rng(6))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)


def test_a_single_clip_goes_round_in_itself(clips):
    stitched = Stitcher(clips[:1])(1000, np.random.default_rng(0))
    assert stitched.shape == (1000, ft.SIZE)


def test_clips_that_are_too_short_are_refused(clips):
    short = clips[0].features[: 2 * BLEND + SHORTEST_STAY]
    with pytest.raises(InputError, match="dog-trot are shorter"):
        Stitcher([Clip("go2", TROT, "r", short)])
