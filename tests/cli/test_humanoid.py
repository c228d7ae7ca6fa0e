"""``humanoid``, ``play`` of what it wrote, and ``data fetch --source human``."""

import hashlib
import json
import re
import zipfile

import pytest

from loco_drake.cli.main import main
from loco_drake.datasets import human_download
from loco_drake.datasets.human import FOLDER
from loco_drake.motion.motion_file import load_motion
from tests.synthetic_human import march, write_person


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A data folder with a march, and one in which nobody stands."""
    folder = tmp_path_factory.mktemp("data")
    write_person(folder / FOLDER, march(0.8, speed=0.6))
    floating = march(0.8, speed=0.6)
    floating[:, 2] += 1.0
    write_person(folder / FOLDER, floating, name="float")
    return folder


def test_clips_become_motion_that_can_be_played(made, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = ["humanoid", "--data-dir", str(made), "--json", "a.json", "--cycles", "2"]
    assert main(line) == 1
    printed = capsys.readouterr()
    assert "Motion files in motions/g1: 1" in printed.out
    assert "Failed: humanoid3d_float: " in printed.err
    figures = json.loads((tmp_path / "a.json").read_text())
    assert "its feet are not on the ground" in figures["humanoid3d_float"]["error"]
    done = figures["human-march"]
    assert done["joint_limit_violations"] == 0
    assert done["penetration_max_m"] < 1e-3
    assert done["stride_period_error"] is None  # of two strides
    motion = load_motion(tmp_path / done["path"])
    assert (motion.robot, len(motion), len(motion.joint_names)) == ("g1", 79, 29)
    assert motion.provenance["cycles"].startswith("2, closed by")
    assert main(["play", done["path"], "--html", "a.html"]) == 0
    assert re.search(r"human-march.npz +g1 +human-march +79", capsys.readouterr().out)
    assert (tmp_path / "a.html").stat().st_size > 1e5


def test_a_file_that_cannot_be_read_is_refused(made, capsys):
    path = made / FOLDER / "humanoid3d_float.txt"
    assert main(["humanoid", str(path)]) == 2
    assert str(path) in capsys.readouterr().err
    assert main(["humanoid", str(path), "--robot", "go2"]) == 2
    assert "Unknown humanoid 'go2'; the choices are g1" in capsys.readouterr().err


def test_without_clips_it_says_how_to_have_them(tmp_path, capsys):
    assert main(["humanoid", "--data-dir", str(tmp_path)]) == 2
    assert "data fetch --source human" in capsys.readouterr().err


@pytest.fixture
def package(made, tmp_path, monkeypatch):
    """A wheel that stands for the package; pip is not asked for it."""
    files = sorted((made / FOLDER).iterdir())
    listed = [
        f"{f.name}: {{bytes: {f.stat().st_size}, "
        f"sha256: {hashlib.sha256(f.read_bytes()).hexdigest()}}}"
        for f in files
    ]
    (tmp_path / "files.yaml").write_text("\n".join(listed))
    monkeypatch.setattr(human_download, "_FILES", tmp_path / "files.yaml")
    wheel = tmp_path / "a.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for file in files:
            archive.write(file, f"pybullet_data/somewhere/{file.name}")
    asked = []
    monkeypatch.setattr(
        human_download, "_download", lambda folder: asked.append(folder) or wheel
    )
    return asked


def test_the_clips_are_fetched_out_of_a_package(package, tmp_path, capsys):
    data = tmp_path / "data"
    line = ["data", "fetch", "--source", "human", "--data-dir", str(data)]
    assert main([*line, "--json", str(tmp_path / "a.json")]) == 0
    printed = capsys.readouterr()
    assert "the origin of the capture is not stated" in printed.out
    assert "pip downloads pybullet==3.2.7" in printed.err
    names = sorted(path.name for path in (data / FOLDER).iterdir())
    assert names == ["humanoid.urdf", "humanoid3d_float.txt", "humanoid3d_march.txt"]
    figures = json.loads((tmp_path / "a.json").read_text())["human"]
    assert (figures["fetched"], figures["already_there"]) == (3, 0)
    # What is there is not asked for again.
    assert main(line) == 0
    assert len(package) == 1


def test_the_clips_are_fetched_from_a_copy(package, made, tmp_path):
    line = ["data", "fetch", "--source", "human", "--data-dir", str(tmp_path / "data")]
    assert main([*line, "--from", str(made)]) == 0
    assert package == []
    assert (tmp_path / "data" / FOLDER / "humanoid3d_march.txt").is_file()


def test_pip_that_fails_says_why(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(human_download, "PACKAGE", "no/such==package")
    line = ["data", "fetch", "--source", "human", "--data-dir", str(tmp_path / "data")]
    assert main(line) == 2
    assert "pip cannot download no/such==package (" in capsys.readouterr().err
    assert not (tmp_path / "data" / FOLDER).exists()
