"""Network weights on disk: safetensors whose header says what they are."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path

FORMAT_VERSION = 1

Network = TypeVar("Network", bound=torch.nn.Module)


def save_weights(
    path: Path,
    kind: str,
    tensors: dict[str, torch.Tensor],
    config: dict[str, Any],
    *,
    half: bool = False,
) -> None:
    """Writes ``tensors`` with their description, wholly or not at all.

    Args:
        path: a ``.safetensors`` file.
        kind: what the weights are of: "tokenizer", "generator", "policy", ...
        tensors: a state dict.
        config: what is needed to build the network again; must be JSON.
        half: whether to store floating-point tensors in 16 bits.
    """
    header = {"format_version": FORMAT_VERSION, "kind": kind, "config": config}
    stored = {
        name: (value.half() if half and value.is_floating_point() else value)
        .detach()
        .cpu()
        .contiguous()
        .clone()
        for name, value in tensors.items()
    }
    with atomic_path(Path(path)) as temporary:
        save_file(stored, temporary, metadata={"loco_drake": json.dumps(header)})


def load_weights(
    path: Path, kind: str
) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Returns the tensors and the config of a weights file.

    What is stored in 16 bits is returned in 32, all else as it is.

    Raises:
        InputError: if the file is missing, damaged, of another kind or version.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"There are no {kind} weights at {str(path)!r}.")
    try:
        with safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})["loco_drake"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        version, found = int(header["format_version"]), str(header["kind"])
        config = dict(header["config"])
    except (SafetensorError, OSError, KeyError, TypeError, ValueError):
        raise InputError(
            f"{path} is damaged or is not a weights file of loco_drake."
        ) from None
    if version != FORMAT_VERSION:
        raise InputError(
            f"{path} has weights format {version}; this version reads {FORMAT_VERSION}."
        )
    if found != kind:
        raise InputError(
            f"{path} holds {found} weights, but {kind} weights are needed."
        )
    return {
        name: value.float() if value.dtype == torch.float16 else value
        for name, value in tensors.items()
    }, config


def load_into(
    module: torch.nn.Module, tensors: dict[str, torch.Tensor], path: Path
) -> None:
    """Copies ``tensors`` into ``module``.

    Raises:
        InputError: if names or shapes do not match.
    """
    try:
        module.load_state_dict(tensors)
    except RuntimeError:
        raise InputError(
            f"The weights in {path} do not fit the network that their header describes."
        ) from None


def load_network(
    path: Path, kind: str, build: Callable[[dict[str, Any]], Network]
) -> Network:
    """Returns the network of a weights file, ready for inference.

    Args:
        path: of the file.
        kind: what it must hold.
        build: returns the network, of any weights, from the "network" of the config.

    Raises:
        InputError: if the file is missing, damaged, or of something else.
    """
    tensors, config = load_weights(path, kind)
    try:
        network = build(dict(config["network"]))
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path} has a damaged {kind} header.") from None
    load_into(network, tensors, path)
    network.eval()
    network.requires_grad_(False)
    return network
