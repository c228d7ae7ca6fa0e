import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.segments import read_segments
from tests.synthetic_robots import MPC_GAITS, write_mpc_recording


@pytest.mark.parametrize("gait", MPC_GAITS)
@pytest.mark.parametrize("fps", [100.0, 200.0])
def test_run_reads_as_what_it_was_made_of(tmp_path, gait, fps):
    robot = write_mpc_recording(tmp_path / "run.txt", gait, fps)
    clip = read_clip("mpc", tmp_path / "run.txt", gait=gait)
    assert (clip.source, clip.gait, clip.fps) == ("mpc", gait, fps)
    np.testing.assert_allclose(clip.withers, robot.withers, atol=2e-5)
    np.testing.assert_allclose(clip.hip, robot.hip, atol=2e-5)
    np.testing.assert_allclose(clip.toes, robot.toes, atol=2e-5)


def test_robot_that_stands_above_the_ground_is_put_on_it_as_a_whole(tmp_path):
    """12 mm, as the pace of the simulator: trunk and feet alike."""
    robot = write_mpc_recording(tmp_path / "run.txt", "pace", ground=0.012)
    clip = read_clip("mpc", tmp_path / "run.txt", gait="pace")
    np.testing.assert_allclose(clip.toes[..., 2], robot.toes[..., 2], atol=1e-5)
    np.testing.assert_allclose(clip.withers[:, 2], 0.2, atol=1e-5)


@pytest.mark.parametrize("gait", MPC_GAITS)
@pytest.mark.parametrize("fps", [100.0, 200.0])
def test_rate_of_a_run_that_was_cut_is_told_by_its_swings(tmp_path, gait, fps):
    """137 rows from anywhere: neither 5 s at 100 nor at 200 frames/s."""
    write_mpc_recording(tmp_path / "run.txt", gait, fps)
    lines = (tmp_path / "run.txt").read_text().splitlines(keepends=True)
    for first in (0, 31, 200, 303):
        (tmp_path / "cut.txt").write_text("".join(lines[first : first + 137]))
        assert read_clip("mpc", tmp_path / "cut.txt", gait=gait).fps == fps


def test_cut_without_a_swing_needs_a_rate(tmp_path):
    write_mpc_recording(tmp_path / "run.txt", "crawl")
    lines = (tmp_path / "run.txt").read_text().splitlines(keepends=True)
    (tmp_path / "cut.txt").write_text("".join(lines[:9]))
    with pytest.raises(InputError, match="--fps 100 or --fps 200"):
        read_clip("mpc", tmp_path / "cut.txt", gait="crawl")
    assert read_clip("mpc", tmp_path / "cut.txt", gait="crawl", fps=200.0).fps == 200.0


def test_run_of_500_rows_that_stands_is_5_s(tmp_path):
    write_mpc_recording(tmp_path / "run.txt", "crawl")
    first = (tmp_path / "run.txt").read_text().splitlines(keepends=True)[0]
    (tmp_path / "run.txt").write_text(500 * first)
    assert read_clip("mpc", tmp_path / "run.txt", gait="crawl").fps == 100.0


def test_real_runs_have_their_rate_whole_or_cut(real_data, tmp_path):
    """Of whole files and of pieces of 1 s: right, or refused, but never wrong."""
    segments = [s for s in read_segments(real_data) if s.source == "mpc"]
    told = 0
    for segment in segments:
        clip = read_clip("mpc", segment.path, gait=segment.gait)
        assert clip.fps == segment.fps
        speed = np.diff((clip.withers + clip.hip)[[-101, -1], 0] / 2) * clip.fps / 100
        assert speed == pytest.approx(float(segment.path.stem.split("_")[1]), rel=0.3)
    for segment in segments[::4]:
        lines = segment.path.read_text().splitlines(keepends=True)
        for first in range(0, 300, 60):
            (tmp_path / "cut.txt").write_text("".join(lines[first : first + 110]))
            try:
                assert (
                    read_clip("mpc", tmp_path / "cut.txt", gait="x").fps == segment.fps
                )
                told += 1
            except InputError:
                continue
    assert told > 3 * len(segments[::4])
