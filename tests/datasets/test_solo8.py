import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.segments import read_segments
from tests.synthetic_robots import DROP_FRAMES, write_solo8_recording


def test_run_reads_as_what_it_was_made_of_from_frame_20(tmp_path):
    """Toes are the lowest points of the balls; the trunk keeps its height."""
    robot = write_solo8_recording(tmp_path / "run.txt")
    clip = read_clip("solo8", tmp_path / "run.txt", gait="walk")
    assert (clip.source, clip.gait, clip.fps) == ("solo8", "walk", 50.0)
    assert clip.provenance["frames"] == "20-120"
    np.testing.assert_allclose(clip.withers, robot.withers[20:], atol=2e-5)
    np.testing.assert_allclose(clip.hip, robot.hip[20:], atol=2e-5)
    np.testing.assert_allclose(clip.toes, robot.toes[20:], atol=2e-5)


def test_stretch_that_begins_in_the_drop_is_refused(tmp_path):
    write_solo8_recording(tmp_path / "run.txt")
    for start in (0, DROP_FRAMES - 2):
        with pytest.raises(InputError, match=r"drops .* best at frame 20"):
            read_clip("solo8", tmp_path / "run.txt", gait="walk", start=start)
    clip = read_clip("solo8", tmp_path / "run.txt", gait="walk", start=10, end=50)
    assert clip.provenance["frames"] == "10-50"


def test_run_without_a_drop_is_read_from_its_start(tmp_path):
    write_solo8_recording(tmp_path / "run.txt", frames=60, drop=False)
    clip = read_clip("solo8", tmp_path / "run.txt", gait="walk")
    assert clip.provenance["frames"] == "0-60"


def test_real_runs_land_and_stand(real_data):
    """Every run drops, and from frame 20 on its lowest foot is within 2 mm of 0."""
    segments = [s for s in read_segments(real_data) if s.source == "solo8"]
    for segment in segments[::5]:
        with pytest.raises(InputError, match="drops to the ground"):
            read_clip("solo8", segment.path, gait=segment.gait, start=0)
        clip = read_clip("solo8", segment.path, gait=segment.gait)
        assert clip.provenance["frames"] == "20-120"
        assert abs(np.percentile(clip.toes[..., 2], 2)) < 0.002
