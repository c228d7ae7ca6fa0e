from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from loco_drake.evaluation.dataset_picture import (
    describe,
    library_figure,
    principal_components,
)
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
    assert point.embedding.shape == (2, 44)
    short = describe(synthetic_motion("dog-pace", 0.5))
    assert short.stride_period is short.duty_factor is None
    assert short.embedding.shape == (0, 44)


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


def test_figure_shows_seconds_by_side_and_every_motion(tmp_path):
    motions = [
        synthetic_motion(label, 3.0, speed, split=side)
        for label in ("dog-trot", "dog-pace")
        for speed, side in ((0.5, "train"), (0.7, "train"), (0.9, "validation"))
    ]
    motions.append(replace(synthetic_motion("dog-trot", 0.5), provenance={}))
    figure = library_figure([describe(motion) for motion in motions], "made")
    seconds, rhythm, duty, embedding = figure.axes
    train, validation = seconds.containers
    widths = [[bar.get_width() for bar in bars] for bars in (train, validation)]
    trot = [str(label) for label in LABELS].index("dog-trot")
    assert [w[trot] for w in widths] == pytest.approx([6.5, 3.0])
    drawn = [len(axes.collections) for axes in (rhythm, duty, embedding)]
    assert drawn == [6 + len(LABELS), 6, 6]
    figure.savefig(tmp_path / "a.png", dpi=40)
    assert matplotlib.image.imread(tmp_path / "a.png").std() > 0.05
