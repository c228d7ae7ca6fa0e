from pathlib import Path

import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import DATASETS, data_dir, get_dataset, read_clip
from loco_drake.motion.gaits import SOURCES
from tests.synthetic import write_dog_recording


def test_each_dataset_is_of_a_known_source_and_names_its_licence():
    for source, dataset in DATASETS.items():
        assert source == dataset.source
        assert source in SOURCES
        assert dataset.licence
        assert dataset.attribution


def test_unknown_source_names_those_that_can_be_read():
    with pytest.raises(InputError, match="'cat'; the choices are dog"):
        get_dataset("cat")


def test_clip_carries_the_licence_of_its_source(tmp_path):
    write_dog_recording(tmp_path / "dog.txt", seconds=1.0)
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace")
    assert clip.provenance["licence"] == "CC BY-NC 4.0"
    assert clip.provenance["file"] == "dog.txt"


@pytest.mark.parametrize("fps", [0.0, -60.0, float("nan"), float("inf"), 0.06, 1e9])
def test_rate_that_cannot_be_is_refused(tmp_path, fps):
    write_dog_recording(tmp_path / "dog.txt", seconds=1.0)
    with pytest.raises(InputError, match="10 to 1000 frames/s"):
        read_clip("dog", tmp_path / "dog.txt", gait="pace", fps=fps)


def test_data_dir_is_the_argument_then_the_variable_then_the_cache(
    tmp_path, monkeypatch
):
    folders = {name: tmp_path / name for name in ("given", "variable", "cache")}
    for folder in folders.values():
        folder.mkdir()
    monkeypatch.setenv("LOCO_DRAKE_DATA", str(folders["variable"]))
    monkeypatch.setenv("LOCO_DRAKE_CACHE", str(folders["cache"]))
    assert data_dir(folders["given"]) == folders["given"]
    assert data_dir() == folders["variable"]
    monkeypatch.delenv("LOCO_DRAKE_DATA")
    with pytest.raises(InputError, match="no data folder"):
        data_dir()
    (folders["cache"] / "data").mkdir()
    assert data_dir() == folders["cache"] / "data"


def test_missing_data_folder_says_how_to_give_one():
    with pytest.raises(InputError, match=r"--data-dir or .*LOCO_DRAKE_DATA"):
        data_dir(Path("nowhere"))
