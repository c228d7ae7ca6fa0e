import matplotlib.image
import numpy as np
import pytest

from loco_drake.datasets.registry import read_clip
from loco_drake.retargeting.inspection import clip_figure, summarize
from tests.synthetic import GAITS, STANCE_HEIGHT, write_dog_recording


@pytest.mark.parametrize("gait", ["pace", "trot", "gallop"])
def test_summary_finds_the_gait_that_the_dog_was_made_with(tmp_path, gait):
    write_dog_recording(tmp_path / "dog.txt", gait, seconds=5.0)
    summary, contacts = summarize(read_clip("dog", tmp_path / "dog.txt", gait=gait))
    made = GAITS[gait]
    assert summary.frames == len(contacts) == 300
    assert summary.stance_height_m == pytest.approx(STANCE_HEIGHT, abs=1e-4)
    assert summary.speed_mean_mps == pytest.approx(made.speed, rel=1e-3)
    assert summary.stride_period_s == pytest.approx(made.period, rel=0.002)
    lag = np.array(summary.phase) - made.phase
    assert np.abs((lag + 0.5) % 1 - 0.5).max() < 0.005
    # Toes take off and land softly: they are low and slow a while longer.
    excess = np.array(summary.duty_factor) - made.duty
    assert (excess > -0.01).all()
    assert (excess < 0.2).all()


def test_standing_dog_has_no_stride(tmp_path):
    write_dog_recording(tmp_path / "dog.txt", "pace")
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace", end=6)
    summary, _ = summarize(clip)
    assert summary.stride_period_s is None
    assert summary.duty_factor is summary.phase is None


def test_figure_shows_each_contact_as_a_bar(tmp_path):
    """Four rows of bars, each as long as its contact; a picture that is not blank."""
    write_dog_recording(tmp_path / "dog.txt", "trot")
    clip = read_clip("dog", tmp_path / "dog.txt", gait="trot")
    _, contacts = summarize(clip)
    figure = clip_figure(clip, contacts, [], "a trot")
    bars = figure.axes[1].collections
    assert len(bars) == 4
    for leg, row in enumerate(bars):
        widths = [np.ptp(path.vertices[:, 0]) for path in row.get_paths()]
        assert sum(widths) == pytest.approx(contacts[:, leg].sum() / clip.fps)
    figure.savefig(tmp_path / "trot.png", dpi=40)
    assert matplotlib.image.imread(tmp_path / "trot.png").std() > 0.05
