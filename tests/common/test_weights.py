"""Weights files: what was written comes back, and nothing else does."""

import json
import math
from dataclasses import dataclass

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save, save_file

from loco_drake.common.errors import InputError
from loco_drake.common.weights import (
    FORMAT_VERSION,
    load_into,
    load_network,
    load_weights,
    save_weights,
)
from loco_drake.models.shipped import pretrained_dir


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


def test_tensors_of_all_types_come_back(tmp_path):
    """A training's state has counters, random states and moments in 64 bits."""
    path = tmp_path / "w.safetensors"
    tensors = {
        "moment": torch.linspace(0, 1, 7, dtype=torch.float64),
        "count": torch.tensor(3),
        "random": torch.arange(256, dtype=torch.uint8),
        "flags": torch.tensor([True, False]),
        "brain": torch.ones(2, dtype=torch.bfloat16),
        "none": torch.zeros(0, 3),
        "scores": torch.tensor([0.5, math.nan]),
    }
    save_weights(path, "checkpoint", tensors, {"state": {"1": [2, 3.5]}})
    with pytest.raises(InputError, match="'scores' is not finite"):
        load_weights(path, "checkpoint")
    again, config = load_weights(path, "checkpoint", ("scores",))
    assert config == {"state": {"1": [2, 3.5]}}
    for name, value in tensors.items():
        torch.testing.assert_close(
            again[name], value, rtol=0, atol=0, equal_nan=name == "scores"
        )


def test_no_flipped_bit_goes_unnoticed(tmp_path):
    """It is refused; where JSON means the same with and without, all is the same."""
    path = tmp_path / "w.safetensors"
    tensors = {"a": torch.arange(6.0).view(2, 3) / 7, "b": torch.zeros(4).half()}
    save_weights(path, "policy", tensors, {"hidden": [2, 3], "rate": 50.0})
    whole, original = path.read_bytes(), load_weights(path, "policy")
    refused = 0
    for bit in range(8 * len(whole)):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        try:
            loaded, config = load_weights(path, "policy")
        except InputError:
            refused += 1
            continue
        assert config == original[1]
        assert loaded.keys() == original[0].keys()
        assert all(torch.equal(loaded[k], v) for k, v in original[0].items())
    assert refused > 0.95 * 8 * len(whole)


def header_of(path):
    with safe_open(path, "pt") as file:
        return json.loads(file.metadata()["loco_drake"])


def test_the_shipped_weights_have_their_hash():
    paths = sorted(pretrained_dir().glob("*.safetensors"))
    assert len(paths) >= 6
    for path in paths:
        assert len(header_of(path)["content_sha256"]) == 64
        load_weights(path, header_of(path)["kind"])


def test_weights_of_earlier_versions_have_no_hash_and_are_read(tmp_path):
    path = tmp_path / "w.safetensors"
    header = {"format_version": 1, "kind": "policy", "config": {"x": 1}}
    metadata = {"loco_drake": json.dumps(header)}
    save_file({"a": torch.ones(3)}, path, metadata=metadata)
    tensors, config = load_weights(path, "policy")
    assert (tensors["a"].tolist(), config) == ([1.0, 1.0, 1.0], {"x": 1})


@pytest.mark.parametrize(
    "metadata",
    [
        None,
        {"other": "{}"},
        {"loco_drake": "[" * 100_000},
        {"loco_drake": "[]"},
        {"loco_drake": '{"format_version": Infinity, "kind": "policy", "config": {}}'},
        {"loco_drake": '{"format_version": 1, "kind": ["policy"], "config": {}}'},
        {"loco_drake": '{"format_version": 1, "kind": "policy", "config": []}'},
        {"loco_drake": '{"format_version": 1, "kind": "\\ud800", "config": {}}'},
        {"loco_drake": '{"format_version": 1, "kind": "policy"}'},
        {"loco_drake": '{"format_version": 1, "kind": "policy", "config": {}, "x": 1}'},
    ],
    ids=lambda metadata: str(metadata)[:60],
)
def test_damaged_headers_are_refused(tmp_path, metadata):
    path = tmp_path / "w.safetensors"
    path.write_bytes(save({"a": torch.ones(3)}, metadata))
    with pytest.raises(InputError, match="is damaged or is not a weights file"):
        load_weights(path, "policy")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused(tmp_path, value):
    path = tmp_path / "w.safetensors"
    save_weights(path, "policy", {"a": torch.tensor([1.0, value])}, {})
    with pytest.raises(InputError, match="'a' is not finite"):
        load_weights(path, "policy")


@pytest.mark.parametrize("kind", [torch.float32, torch.float64, torch.bfloat16])
def test_what_no_training_leads_to_is_refused(tmp_path, kind):
    """Files without a hash, too: the highest bit of an exponent changes so much."""
    path = tmp_path / "w.safetensors"
    for value, refused in ((1e11, False), (-1e30, True)):
        header = {"format_version": 1, "kind": "policy", "config": {}}
        tensors = {"a": torch.tensor([1.0, value], dtype=kind)}
        save_file(tensors, path, metadata={"loco_drake": json.dumps(header)})
        if refused:
            with pytest.raises(InputError, match="'a' holds numbers beyond 1e\\+12"):
                load_weights(path, "policy")
        else:
            load_weights(path, "policy")


@dataclass(frozen=True)
class LinearConfig:
    inputs: int
    labels: tuple[str, ...]
    bias: bool = True
    scale: float = 1.0


class Linear(torch.nn.Linear):
    def __init__(self, config: LinearConfig) -> None:
        super().__init__(config.inputs, len(config.labels), config.bias)
        self.config = config


def write_linear(path, tensors=None, **network):
    network = {"inputs": 3, "labels": ["x", "y"], **network}
    own = {"weight": torch.ones(2, 3), "bias": torch.zeros(2)}
    own = {k: v for k, v in {**own, **(tensors or {})}.items() if v is not None}
    save_weights(path, "linear", own, {"network": network})


def test_a_network_is_built_from_its_header(tmp_path):
    path = tmp_path / "w.safetensors"
    write_linear(path, scale=2)
    network = load_network(path, "linear", Linear, LinearConfig)
    assert network.config == LinearConfig(3, ("x", "y"), scale=2)
    assert network(torch.ones(3)).tolist() == [3.0, 3.0]
    assert not network.training
    assert not network.weight.requires_grad


@pytest.mark.parametrize(
    "network",
    [
        {"inputs": 4096},
        {"labels": ["x"]},
        {"bias": False},
    ],
    ids=str,
)
def test_a_network_of_another_size_is_refused(tmp_path, network):
    path = tmp_path / "w.safetensors"
    write_linear(path, **network)
    with pytest.raises(InputError, match="do not fit the network"):
        load_network(path, "linear", Linear, LinearConfig)


@pytest.mark.parametrize(
    "network",
    [
        {"inputs": 10**12},
        {"inputs": 0},
        {"inputs": -3},
        {"inputs": 3.0},
        {"inputs": True},
        {"inputs": "3"},
        {"inputs": None},
        {"labels": "xy"},
        {"labels": [1, 2]},
        {"labels": ["x"] * 10**6},
        {"scale": "1"},
        {"bias": 1},
        {"unknown": 1},
    ],
    ids=lambda network: str(network)[:40],
)
def test_a_network_that_cannot_be_is_refused(tmp_path, network):
    path = tmp_path / "w.safetensors"
    write_linear(path, **network)
    with pytest.raises(InputError, match=r"damaged header: '.*' is wrong"):
        load_network(path, "linear", Linear, LinearConfig)


def test_a_network_that_cannot_be_built_is_refused(tmp_path):
    def make(config: LinearConfig) -> Linear:
        raise AssertionError("sizes that do not go together")

    path = tmp_path / "w.safetensors"
    write_linear(path)
    with pytest.raises(InputError, match="no network can be built from it"):
        load_network(path, "linear", make, LinearConfig)


@pytest.mark.parametrize(
    "tensors",
    [
        {"weight": torch.ones(2, 3, dtype=torch.float64)},
        {"weight": torch.ones(2, 3, dtype=torch.int64)},
        {"weight": torch.ones(3, 2)},
        {"weight": torch.ones(6)},
        {"weight": None},
        {"more": torch.ones(1)},
    ],
    ids=lambda tensors: str({k: v is not None and v.dtype for k, v in tensors.items()}),
)
def test_other_tensors_are_refused(tmp_path, tensors):
    path = tmp_path / "w.safetensors"
    write_linear(path, tensors)
    with pytest.raises(InputError, match="do not fit the network"):
        load_network(path, "linear", Linear, LinearConfig)


def test_a_matrix_of_zeros_needs_a_hash_and_a_vector_of_zeros_does_not(tmp_path):
    """Biases are zero at first; a policy may be, too, which does nothing."""
    path = tmp_path / "w.safetensors"
    write_linear(path, {"weight": torch.zeros(2, 3)})
    network = load_network(path, "linear", Linear, LinearConfig)
    assert network(torch.ones(3)).tolist() == [0.0, 0.0]
    config = {"network": {"inputs": 3, "labels": ["x", "y"]}}
    header = {"format_version": FORMAT_VERSION, "kind": "linear", "config": config}
    for weight, refused in ((torch.zeros(2, 3), True), (torch.ones(2, 3), False)):
        tensors = {"weight": weight, "bias": torch.zeros(2)}
        save_file(tensors, path, metadata={"loco_drake": json.dumps(header)})
        if refused:
            with pytest.raises(InputError, match="'weight' is zero throughout"):
                load_network(path, "linear", Linear, LinearConfig)
        else:
            load_network(path, "linear", Linear, LinearConfig)
