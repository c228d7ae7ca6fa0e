import json
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.evaluation.dataset_picture import library_figure
from loco_drake.evaluation.library import (
    describe,
    library_results,
    make_library,
    principal_components,
    read_library,
)
from loco_drake.evaluation.report.figures import Figures
from loco_drake.motion.gaits import LABELS
from tests.synthetic_motion import synthetic_motion


def test_a_motion_is_described_as_it_was_made():
    """4.4 s at .8 m/s, period .45 s, feet down half of the time: two rows of 2 s."""
    motion = synthetic_motion(
        "dog-pace", 4.4, speed=0.8, turn=0.3, period=0.45, split="validation"
    )
    point = describe(motion)
    assert (str(point.label), point.side) == ("dog-pace", "validation")
    assert point.seconds == pytest.approx(4.4)
    assert point.speed == pytest.approx(0.8, rel=0.01)
    assert point.stride_period == pytest.approx(0.45, abs=0.002)
    assert point.duty_factor == pytest.approx(0.5, abs=0.05)
    assert point.summaries.shape == (2, 44)
    short = describe(synthetic_motion("dog-pace", 0.5))
    assert short.stride_period is short.duty_factor is None
    assert short.summaries.shape == (0, 44)


def test_principal_components_by_hand():
    """Two columns that rise together, the second ten times as far: one direction."""
    along = np.array([-1.0, 0.0, 1.0])
    rows = np.stack((along, 10 * along, 0 * along), axis=-1)
    projected, share = principal_components(rows)
    np.testing.assert_allclose(share, [1.0, 0.0], atol=1e-12)
    # Both columns have a standard deviation of (2 / 3)^.5: 3^.5 along the diagonal.
    np.testing.assert_allclose(
        np.abs(projected[:, 0]), np.sqrt(3) * np.abs(along), atol=1e-12
    )


@pytest.fixture(scope="module")
def library():
    """Six motions of two gaits, and one of half a second."""
    motions = [
        synthetic_motion(label, 3.0, speed, split=side)
        for label in ("dog-trot", "dog-pace")
        for speed, side in ((0.5, "train"), (0.7, "train"), (0.9, "validation"))
    ]
    motions.append(replace(synthetic_motion("dog-trot", 0.5), provenance={}))
    return make_library(describe(motion) for motion in motions)


def test_results_give_the_same_library_again(library):
    written = json.loads(json.dumps({"library": library_results(library)}))
    again = read_library(Figures(written))
    assert len(again.points) == 7
    assert again.seconds == pytest.approx(library.seconds, abs=1e-3)
    assert again.variance == pytest.approx(library.variance, abs=1e-4)
    for one, other in zip(library.points, again.points, strict=True):
        assert (one.label, one.side) == (other.label, other.side)
        assert one.speed == pytest.approx(other.speed, abs=1e-4)
        assert (one.stride_period is None) == (other.stride_period is None)
        np.testing.assert_allclose(one.summaries, other.summaries, atol=1e-4)
    written["library"]["clips"][0]["label"] = "cat-sneak"
    assert len(read_library(Figures(written)).points) == 6


@pytest.mark.parametrize(
    ("key", "wrong", "reason"),
    [
        ("split", "test", "split is 'test', neither train nor validation"),
        ("duration_s", None, "a clip of its library has no duration or no speed"),
        ("speed_mps", "fast", "speed_mps is 'fast', not a number"),
        ("components", [[1.0]], "components is no list of pairs of numbers"),
        ("components", [[1.0, float("nan")]], "components is no list of pairs"),
        ("components", 3, "components is no list of pairs of numbers"),
    ],
)
def test_a_damaged_library_is_refused(library, key, wrong, reason):
    written = {"library": library_results(library)}
    written["library"]["clips"][0][key] = wrong
    with pytest.raises(InputError, match=reason):
        read_library(Figures(written))


def test_of_two_summaries_there_are_no_components():
    points = [describe(synthetic_motion("dog-pace", 4.4, period=0.45))]
    assert len(points[0].summaries) == 2
    library = make_library(points)
    assert library.variance == (0.0, 0.0)
    assert library.points[0].summaries.shape == (0, 2)


def test_figure_shows_seconds_by_side_and_every_motion(library, tmp_path):
    figure = library_figure(library)
    seconds, rhythm, duty, embedding = figure.axes
    train, validation = seconds.containers
    widths = [[bar.get_width() for bar in bars] for bars in (train, validation)]
    trot = [str(label) for label in LABELS].index("dog-trot")
    assert [w[trot] for w in widths] == pytest.approx([6.5, 3.0])
    drawn = [len(axes.collections) for axes in (rhythm, duty, embedding)]
    assert drawn == [6 + len(LABELS), 6, 6]
    figure.savefig(tmp_path / "a.png", dpi=40)
    assert matplotlib.image.imread(tmp_path / "a.png").std() > 0.05
