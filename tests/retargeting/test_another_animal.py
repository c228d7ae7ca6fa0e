"""A source of one's own, from an installed package to torque."""

import json
import subprocess
import sys

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets import registry
from loco_drake.datasets.registry import Dataset, Recording, register_dataset
from tests.synthetic import GAITS, make_steps

PACKAGE = """
from pathlib import Path

import numpy as np

from loco_drake.datasets.registry import Dataset, Recording


def read_elephant(path, start, end, fps):
    return Recording(np.load(path), fps or 50.0)


ELEPHANT = Dataset(
    source="elephant",
    folder="elephants",
    licence="CC0",
    attribution="nobody",
    read=read_elephant,
    config=Path(__file__).with_name("elephant.yaml"),
)
"""


@pytest.fixture
def package(tmp_path):
    """A folder for the path of Python, as pip would fill it."""
    folder = tmp_path / "site"
    (folder / "zoo-1.0.dist-info").mkdir(parents=True)
    (folder / "zoo.py").write_text(PACKAGE)
    (folder / "elephant.yaml").write_text("hip_spread: 0.1\n")
    info = folder / "zoo-1.0.dist-info"
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: zoo\nVersion: 1.0\n")
    points = "[loco_drake.datasets]\nelephant = zoo:ELEPHANT\n"
    (info / "entry_points.txt").write_text(points)
    return folder


def elephant():
    """Six points of a body 2.5 m high that walks, trunk 2 m long, (T, 6, 3)."""
    time = np.arange(300) / 50.0
    gait = GAITS["pace"].__class__(1.6, 1.5, 0.6, (0.25, 0.75, 0.0, 0.5))
    toes, _ = make_steps(gait, time, (1.0, -1.0), 0.4, 0.3)
    middle = np.stack((1.5 * time, 0 * time, 2.5 + 0 * time), axis=-1)
    half = np.array([1.0, 0.0, 0.0])
    ends = np.stack((middle + half, middle - half), axis=1)
    return np.concatenate((ends, toes), axis=1)


def run(package, *arguments):
    code = "import sys; from loco_drake.cli.main import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        env={"PYTHONPATH": str(package), "OMP_NUM_THREADS": "1", "HOME": str(package)},
        cwd=package,
        capture_output=True,
        text=True,
        check=False,
    )


def test_installed_dataset_is_listed_retargeted_and_simulated(package, tmp_path):
    """Without a change to the package, and with its shipped weights."""
    data = tmp_path / "data"
    (data / "elephants").mkdir(parents=True)
    np.save(data / "elephants" / "jumbo.npy", elephant())
    rows = "dataset,file,gait,start_frame,end_frame,fps\n"
    (data / "segments.csv").write_text(rows + "elephants,jumbo.npy,walk,0,300,50\n")
    listing = run(
        package, "data", "list", "--data-dir", data, "--json", data / "a.json"
    )
    assert listing.returncode == 0, listing.stderr
    assert json.loads((data / "a.json").read_text())["elephant"]["seconds"] == 6.0

    options = ("--data-dir", data, "--gait", "walk", "--out", tmp_path / "out")
    done = run(package, "retarget", *options, "--source", "elephant", "--workers", 2)
    assert done.returncode == 0, done.stderr
    (motion,) = (tmp_path / "out").glob("elephant-walk-jumbo-npy-0-300.npz")
    played = run(
        package, "simulate", "--no-meshcat", "--duration", 1, "--reference", motion
    )
    assert played.returncode == 0, played.stderr


def test_installed_dataset_that_breaks_is_named(package):
    (package / "zoo.py").write_text("raise KeyError('no zoo')")
    listing = run(package, "data", "list")
    assert listing.returncode == 2
    (sentence,) = listing.stderr.splitlines()
    assert "installed dataset 'elephant' cannot be registered: KeyError" in sentence


@pytest.fixture
def known(monkeypatch):
    monkeypatch.setattr(registry, "DATASETS", dict(registry.DATASETS))


def dataset(**changes):
    values = {"source": "elephant", "folder": "elephants", "licence": "CC0"}
    values |= {"attribution": "nobody", "read": lambda *_: Recording(elephant(), 50.0)}
    return Dataset(**{**values, **changes})


@pytest.mark.usefixtures("known")
def test_dataset_registered_in_a_script_is_read_and_checked(tmp_path):
    """Its ground may be anywhere, like that of any source."""
    low = Recording(elephant() - [0, 0, 0.7], 50.0)
    register_dataset(dataset(read=lambda *_: low))
    clip = registry.read_clip("elephant", tmp_path, gait="walk", start=10)
    assert len(clip) == 290
    np.testing.assert_allclose(clip.withers[:, 2], 2.5, atol=1e-9)
    assert clip.provenance["ground"] == "moved from z = -0.700 m to 0"


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"source": "dog"}, "There is a source 'dog'"),
        ({"folder": "dog_mann"}, "There is a source 'dog'"),
        ({"source": "a-b"}, "letters and digits only"),
        ({"folder": "../x"}, "not the name of a dataset's folder"),
    ],
)
def test_dataset_that_cannot_be_is_refused(changes, reason):
    with pytest.raises(InputError, match=reason):
        register_dataset(dataset(**changes))


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize(
    "wrong", [np.zeros((9, 5, 3)), np.full((9, 6, 3), np.nan), None, "text"]
)
def test_reader_that_breaks_ends_in_one_sentence(wrong, tmp_path):
    register_dataset(dataset(read=lambda *_: Recording(wrong, 50.0)))
    with pytest.raises(InputError, match=r"lacks points of the body|cannot be read as"):
        registry.read_clip("elephant", tmp_path, gait="walk")
