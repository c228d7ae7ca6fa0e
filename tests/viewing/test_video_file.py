from pathlib import Path

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.viewing import video_file
from loco_drake.viewing.rendering import HEIGHT, WIDTH
from loco_drake.viewing.video_file import check_video, write_video
from tests.viewing.pictures import read_video

COUNT = 12


def bar(k):
    """Returns a picture of a white bar that moves over a grey ground by its width."""
    picture = np.full((HEIGHT, WIDTH, 3), 100, dtype=np.uint8)
    picture[:, 40 * k : 40 * (k + 1)] = 250
    return picture


@pytest.mark.parametrize("suffix", [".mp4", ".webp", ".gif"])
def test_all_pictures_come_back_in_time(suffix, tmp_path):
    if suffix == ".mp4":
        pytest.importorskip("imageio_ffmpeg", reason="needs the extra 'video'")
    path = tmp_path / f"a{suffix}"
    write_video(path, map(bar, range(COUNT)))
    pictures, rate = read_video(path)
    assert len(pictures) == COUNT
    assert rate == pytest.approx(25)
    scale = 2 if suffix == ".gif" else 1
    for k, picture in enumerate(pictures):
        assert picture.shape == (HEIGHT // scale, WIDTH // scale, 3)
        bright = np.flatnonzero(picture[5, :, 0] > 175) * scale
        assert abs(bright.min() - 40 * k) <= 3
        assert abs(bright.max() - 40 * k - 39) <= 3
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", [".mp4", ".webp"])
def test_a_video_that_cannot_be_finished_leaves_nothing(suffix, tmp_path):
    if suffix == ".mp4":
        pytest.importorskip("imageio_ffmpeg", reason="needs the extra 'video'")

    def pictures():
        yield bar(0)
        raise OSError("no more")

    with pytest.raises(OSError, match="no more"):
        write_video(tmp_path / f"a{suffix}", pictures())
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_said_before(monkeypatch):
    with pytest.raises(InputError, match=r"named \*.mp4, \*.webp, \*.gif, not 'a.avi'"):
        check_video(Path("a.avi"), 1.0)
    with pytest.raises(InputError, match="121 s must be an MP4: WebP and GIF hold at"):
        check_video(Path("a.webp"), 121.0)
    check_video(Path("A.WEBP"), 119.0)
    monkeypatch.setattr(video_file, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="install the package imageio-ffmpeg"):
        check_video(Path("a.mp4"), 1.0)
