from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.segments import read_segments
from loco_drake.retargeting.retarget import SegmentRetargeter
from loco_drake.retargeting.scaling import Variant, resample
from loco_drake.viewing.source_clip import source_clip


@pytest.mark.parametrize("variant", [Variant(), Variant(mirror=True, froude=True)])
def test_the_source_moves_as_the_robot_does(go2, made_data, variant):
    """Its trunk, in the size and time of the robot, goes where the robot's does."""
    segment = read_segments(made_data)[1]
    _, motion, _ = SegmentRetargeter(go2, variant=variant)(segment)
    clip = resample(source_clip(motion, made_data), motion.fps)
    assert abs(len(clip) - len(motion)) <= 1
    frames = min(len(clip), len(motion))
    away = clip.middle[:frames] - motion.base_position[:frames]
    np.testing.assert_allclose(away, 0, atol=0.03)
    assert np.ptp(motion.base_position[:, 0]) > 0.5


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"file": None}, "its provenance names no file of a recording"),
        ({"scale": None}, "its provenance names no scale"),
        ({"file": "lost.txt"}, "there is no lost.txt in "),
        ({"file": "*.txt"}, r"there is no \*.txt in "),
        ({"file": "../dog_mann"}, "there is no ../dog_mann in "),
        ({"frames": "a-b"}, "its provenance is damaged"),
        ({"frames": "0-100000"}, "do not lie within the file"),
    ],
)
def test_a_source_that_is_not_there_is_said(go2, made_data, changes, reason):
    _, motion, _ = SegmentRetargeter(go2)(read_segments(made_data)[1])
    known = {k: v for k, v in {**motion.provenance, **changes}.items() if v}
    with pytest.raises(InputError, match=reason):
        source_clip(replace(motion, provenance=known), made_data)
