"""Labels, keypoint clips, weights files, whole files."""

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path, cache_dir
from loco_drake.common.weights import load_into, load_weights, save_weights
from loco_drake.motion.gaits import (
    GAITS,
    LABELS,
    ONE_HOT,
    SOURCES,
    GaitLabel,
    parse_label,
)
from loco_drake.motion.keypoints import KeypointClip


def test_there_are_the_papers_fifteen_labels():
    counts = {s: sum(label.source == s for label in LABELS) for s in SOURCES}
    assert counts == {"dog": 3, "horse": 2, "mpc": 4, "solo8": 6}
    assert len(set(LABELS)) == 15


def test_labels_are_written_and_read():
    for i, label in enumerate(LABELS):
        assert parse_label(str(label)) == label
        assert label.index == i
    with pytest.raises(InputError, match=r"'dog-waltz'; the choices are dog-pace, dog"):
        parse_label("dog-waltz")


def test_one_hots_are_two():
    assert ONE_HOT.shape == (45, 12)
    row = ONE_HOT[parse_label("mpc-bound").index]
    assert set(np.flatnonzero(row)) == {
        SOURCES.index("mpc"),
        len(SOURCES) + GAITS.index("bound"),
    }


@pytest.mark.parametrize(
    ("source", "gait", "columns"),
    [
        ("dog", "walk", [0, 4 + 3]),
        ("elephant", "walk", [4 + 3]),
        ("horse", "canter", [1]),
        ("several", "gaits", []),
    ],
)
def test_labels_beyond_the_fifteen_keep_the_columns_that_are_known(
    source, gait, columns
):
    """Shipped networks have no input for what they have never seen."""
    row = GaitLabel(source, gait).index
    assert row >= len(LABELS)
    assert np.flatnonzero(ONE_HOT[row]).tolist() == columns


def clip(**changes):
    arrays = {
        "withers": np.zeros((5, 3)),
        "hip": np.zeros((5, 3)),
        "toes": np.zeros((5, 4, 3)),
    }
    values = {"source": "dog", "gait": "trot", "fps": 60.0, "provenance": {}}
    return KeypointClip(**{**values, **arrays, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"source": "c\nat"}, r"A source must have .* not be 'c\\nat'"),
        ({"gait": ""}, "A gait must have 1 to 64"),
        ({"fps": 0.0}, "rate above 0"),
        ({"hip": np.zeros((4, 3))}, "hip .* must have shape"),
        ({"toes": np.full((5, 4, 3), np.inf)}, "NaN or infinity"),
    ],
)
def test_unsound_clips_are_refused(changes, message):
    assert len(clip()) == 5
    with pytest.raises(InputError, match=message):
        clip(**changes)


def test_weights_come_back_with_their_config(tmp_path):
    path = tmp_path / "w.safetensors"
    tensors = {"a": torch.arange(6.0).view(2, 3) / 7, "n": torch.tensor([3])}
    save_weights(path, "policy", tensors, {"hidden": [2, 3]})
    again, config = load_weights(path, "policy")
    assert config == {"hidden": [2, 3]}
    assert all(torch.equal(again[name], value) for name, value in tensors.items())


def test_half_precision_is_read_in_full(tmp_path):
    path = tmp_path / "w.safetensors"
    value = torch.linspace(-1, 1, 999)
    save_weights(path, "policy", {"a": value}, {}, half=True)
    assert path.stat().st_size < 999 * 2 + 500
    again, _ = load_weights(path, "policy")
    assert again["a"].dtype == torch.float32
    torch.testing.assert_close(again["a"], value, atol=5e-4, rtol=0)


def test_wrong_weights_are_refused_in_a_sentence(tmp_path):
    path = tmp_path / "w.safetensors"
    with pytest.raises(InputError, match="no policy weights"):
        load_weights(path, "policy")
    save_weights(path, "tokenizer", {"a": torch.zeros(3)}, {})
    with pytest.raises(InputError, match="holds tokenizer weights, but policy"):
        load_weights(path, "policy")
    with pytest.raises(InputError, match="do not fit"):
        load_into(torch.nn.Linear(2, 2), {"a": torch.zeros(3)}, path)
    whole = path.read_bytes()
    for damaged in (b"", whole[:-5], whole[:20], b"\xff" * 100):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="damaged"):
            load_weights(path, "tokenizer")


def test_weights_of_a_later_format_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "w.safetensors"
    monkeypatch.setattr("loco_drake.common.weights.FORMAT_VERSION", 9)
    save_weights(path, "policy", {"a": torch.zeros(3)}, {})
    monkeypatch.undo()
    with pytest.raises(InputError, match="format 9; this version reads 1"):
        load_weights(path, "policy")


def test_a_file_is_whole_or_as_it_was(tmp_path):
    path = tmp_path / "new" / "file.txt"
    with atomic_path(path) as temporary:
        temporary.write_text("one")
        assert temporary.suffix == ".txt"
    with pytest.raises(ZeroDivisionError), atomic_path(path) as temporary:
        temporary.write_text(f"two {1 / 0}")
    assert path.read_text() == "one"
    assert list(path.parent.iterdir()) == [path]


def test_the_cache_can_be_moved(monkeypatch, tmp_path):
    monkeypatch.setenv("LOCO_DRAKE_CACHE", str(tmp_path))
    assert cache_dir() == tmp_path
    monkeypatch.delenv("LOCO_DRAKE_CACHE")
    assert cache_dir().name == "loco_drake"
