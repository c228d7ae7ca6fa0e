import json

import numpy as np
import pytest
from pydrake.geometry import Meshcat

from loco_drake.cli import play
from loco_drake.cli.main import main
from loco_drake.models.robots import load_robot
from loco_drake.motion.motion_file import save_motion
from loco_drake.viewing.player import FORWARD, PAUSE, STOP
from tests.meshcat_messages import animation, click
from tests.robot_files import SOLO8
from tests.synthetic_motion import synthetic_motion
from tests.viewing.motions import swinging
from tests.viewing.pictures import needs_renderer, read_video, robot_columns


@pytest.fixture
def files(tmp_path):
    """A trot of Go2 of .6 s, a pace of A1 of 1 s, and half a second of Solo8."""
    made = {
        "trot": synthetic_motion(seconds=0.6),
        "pace": synthetic_motion("dog-pace", seconds=1.0, name="a1"),
        "solo8": swinging(load_robot(str(SOLO8))),
    }
    paths = {name: tmp_path / f"{name}.npz" for name in made}
    for name, motion in made.items():
        save_motion(motion, paths[name])
    return paths


def test_a_page_of_three_robots_and_what_is_said_of_them(files, tmp_path, capsys):
    page, figures = tmp_path / "a.html", tmp_path / "a.json"
    line = ["play", *map(str, files.values()), "--robot", str(SOLO8)]
    assert main([*line, "--html", str(page), "--json", str(figures)]) == 0
    told = json.loads(figures.read_text())
    assert told["files"] == [
        {"file": str(path), "robot": robot, "label": label, "frames": n, "seconds": s}
        for path, robot, label, n, s in (
            (files["trot"], "go2", "dog-trot", 31, 0.6),
            (files["pace"], "a1", "dog-pace", 51, 1.0),
            (files["solo8"], "solo8", "made-swing", 25, 0.48),
        )
    ]
    assert told["seconds"] == pytest.approx(2.08)
    assert "dog-pace" in capsys.readouterr().out
    text = page.read_text()
    assert "<html" in text[:1000]
    heights = {
        path.split("/")[3]: np.array([value[2] for _, value in keys])
        for (path, name), keys in animation(text).items()
        if name == ".position" and path.endswith(("/base", "/base_link"))
    }
    # One after another: 20, 33 and 16 pictures at 32 a second.
    for number, (first, count) in enumerate(((0, 20), (20, 33), (53, 16))):
        seen = np.flatnonzero(heights[f"figure{number}"] > 0)
        np.testing.assert_array_equal(seen, first + np.arange(count))


@needs_renderer
def test_a_video_of_files_side_by_side_shows_both(files, tmp_path):
    path = tmp_path / "a.webp"
    line = ["play", str(files["trot"]), str(files["trot"]), "--side-by-side"]
    assert main([*line, "--video", str(path)]) == 0
    pictures, rate = read_video(path)
    assert pictures.shape == (16, 360, 640, 3)
    assert rate == pytest.approx(25)
    assert robot_columns(pictures[0]).sum() > 64
    assert (np.abs(pictures[0].astype(int) - pictures[-1]) > 30).mean() > 0.01
    assert path.stat().st_size < 16 / 250 * 5e6


@pytest.mark.slow
@needs_renderer
@pytest.mark.parametrize("suffix", [".mp4", ".webp", ".gif"])
def test_a_video_of_a_run_over_metres_keeps_the_robot_in_it(suffix, tmp_path):
    if suffix == ".mp4":
        pytest.importorskip("imageio_ffmpeg", reason="needs the extra 'video'")
    save_motion(synthetic_motion(seconds=2.0, speed=1.6), tmp_path / "a.npz")
    path = tmp_path / f"a{suffix}"
    assert main(["play", str(tmp_path / "a.npz"), "--video", str(path)]) == 0
    pictures, rate = read_video(path)
    assert len(pictures) == 51
    assert rate == pytest.approx(25)
    for k in (0, 25, 50):
        assert robot_columns(pictures[k]).mean() > 0.1
    # 10 s of it are below 5 MB.
    assert path.stat().st_size < 1e6


def test_the_source_is_shown_where_it_is_found(files, made_data, tmp_path, capsys):
    line = ["retarget", "--source", "dog", "--gait", "trot", "--trajectories", "0"]
    out = tmp_path / "motions"
    data = ["--data-dir", str(made_data)]
    assert main([*line, *data, "--out", str(out)]) == 0
    (motion,) = out.glob("*.npz")
    page, figures = tmp_path / "a.html", tmp_path / "a.json"
    line = ["play", str(motion), str(files["trot"]), "--keypoints", *data]
    assert main([*line, "--html", str(page), "--json", str(figures)]) == 0
    first, second = json.loads(figures.read_text())["files"]
    assert first["source"] == "made_trot.txt"
    assert second["source"] is None
    error = capsys.readouterr().err
    assert "trot.npz is shown without its source: its provenance names no file" in error
    tracks = animation(page.read_text())
    hips = tracks["/drake/illustration/points0/hip", ".position"]
    heights = np.array([value[2] for _, value in hips])
    # It is there with the first file only.
    count = int(first["seconds"] * 32 + 1e-6) + 1
    assert (heights[:count] > 0.1).all()
    assert (heights[count:] < 0).all()


def test_it_plays_until_the_page_stops_it(files, monkeypatch, capsys):
    """Its clock is the wall's; the controls are those of the player."""
    made = []

    def open_meshcat(port, *, announce):
        made.append(Meshcat())
        return made[0]

    frames = []

    def sleep(seconds):
        if not frames:
            click(made[0], PAUSE)
        if len(frames) in (1, 2):
            click(made[0], FORWARD)
        if len(frames) == 4:
            click(made[0], STOP)
        frames.append(made[0].GetSliderValue("frame"))

    monkeypatch.setattr(play, "start_meshcat", open_meshcat)
    monkeypatch.setattr(play.time, "sleep", sleep)
    assert main(["play", str(files["trot"])]) == 0
    assert "Ctrl-C ends" in capsys.readouterr().out
    first, *_, last = frames
    assert (first, last) == (0, 2)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "Name at least one Motion file to play"),
        ("none.npz", "There is no Motion file 'none.npz'"),
        ("{solo8}", "is a motion of solo8, not of go2, a1: name the YAML file"),
        ("{solo8} --robot spot", "Unknown robot 'spot'"),
        ("{trot} --video a.avi", r"named *.mp4, *.webp, *.gif, not 'a.avi'"),
        ("{trot} --keypoints --data-dir none", "There is no data folder 'none'"),
        ("{trot} --port 1", "The port must be from 1024 to 65535"),
        ("--side-by-side" + 13 * " {trot}", "At most 12 files"),
    ],
)
def test_what_cannot_be_played_is_one_sentence(
    line, message, files, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.iterdir())
    assert main(["play", *line.format(**files).split()]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error
    assert set(tmp_path.iterdir()) == before
