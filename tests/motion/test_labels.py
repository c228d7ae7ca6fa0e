"""Labels and keypoint clips."""

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import (
    ANY_INDEX,
    GAITS,
    LABELS,
    ONE_HOT,
    SOURCES,
    GaitLabel,
    gait_index,
    gait_name,
    parse_label,
)
from loco_drake.motion.keypoints import KeypointClip


def test_there_are_the_papers_fifteen_labels():
    counts = {s: sum(label.source == s for label in LABELS) for s in SOURCES}
    assert counts == {"dog": 3, "horse": 2, "mpc": 4, "solo8": 6}
    assert len(set(LABELS)) == 15


def test_labels_are_written_and_read():
    for i, label in enumerate(LABELS):
        assert parse_label(str(label)) == label
        assert label.index == i
    with pytest.raises(InputError, match=r"'dog-waltz'; the choices are dog-pace, dog"):
        parse_label("dog-waltz")


def test_a_gait_to_be_walked_may_be_any():
    for index in (ANY_INDEX, *range(len(LABELS))):
        assert gait_index(gait_name(index)) == index
    assert (gait_name(ANY_INDEX), gait_name(1)) == ("any", "dog-trot")
    with pytest.raises(InputError, match=r"'all'; the choices are any, dog-pace, dog"):
        gait_index("all")


def test_one_hots_are_two():
    assert ONE_HOT.shape == (45, 12)
    row = ONE_HOT[parse_label("mpc-bound").index]
    assert set(np.flatnonzero(row)) == {
        SOURCES.index("mpc"),
        len(SOURCES) + GAITS.index("bound"),
    }


@pytest.mark.parametrize(
    ("source", "gait", "columns"),
    [
        ("dog", "walk", [0, 4 + 3]),
        ("elephant", "walk", [4 + 3]),
        ("horse", "canter", [1]),
        ("several", "gaits", []),
    ],
)
def test_labels_beyond_the_fifteen_keep_the_columns_that_are_known(
    source, gait, columns
):
    """Shipped networks have no input for what they have never seen."""
    row = GaitLabel(source, gait).index
    assert row >= len(LABELS)
    assert np.flatnonzero(ONE_HOT[row]).tolist() == columns


def clip(**changes):
    arrays = {
        "withers": np.zeros((5, 3)),
        "hip": np.zeros((5, 3)),
        "toes": np.zeros((5, 4, 3)),
    }
    values = {"source": "dog", "gait": "trot", "fps": 60.0, "provenance": {}}
    return KeypointClip(**{**values, **arrays, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"source": "c\nat"}, r"A source must have .* not be 'c\\nat'"),
        ({"gait": ""}, "A gait must have 1 to 64"),
        ({"fps": 0.0}, "rate above 0"),
        ({"hip": np.zeros((4, 3))}, "hip .* must have shape"),
        ({"toes": np.full((5, 4, 3), np.inf)}, "NaN or infinity"),
    ],
)
def test_unsound_clips_are_refused(changes, message):
    assert len(clip()) == 5
    with pytest.raises(InputError, match=message):
        clip(**changes)
