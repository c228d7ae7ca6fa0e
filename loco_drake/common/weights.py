"""Network weights as safetensors files with a descriptive header."""

import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor

from loco_drake.common.errors import InputError, quoted
from loco_drake.common.files import atomic_path, content_sha256, parse_json
from loco_drake.common.typed import FieldError, convert

FORMAT_VERSION = 1
MAX_BYTES = 4 * 2**30  # of a file
# No training leads there; it is what a flipped bit of an exponent leaves.
MAX_VALUE = 1e12
MAX_SIZE = 4096  # any number of channels, layers, codes, ... in a header

Network = TypeVar("Network", bound=torch.nn.Module)
Config = TypeVar("Config")


def save_weights(
    path: Path,
    kind: str,
    tensors: dict[str, Tensor],
    config: dict[str, Any],
    *,
    half: bool = False,
) -> None:
    """Writes ``tensors`` with their description and hash, atomically.

    Args:
        path: a ``.safetensors`` file.
        kind: kind of weights: "tokenizer", "generator", "policy", ...
        tensors: a state dict of any types.
        config: JSON from which to rebuild the network.
        half: whether to store floating-point tensors in 16 bits.
    """
    stored = {
        name: (value.half() if half and value.is_floating_point() else value)
        .detach()
        .cpu()
        .contiguous()
        .clone()
        for name, value in tensors.items()
    }
    # As it is read back: JSON has no tuples and no numeric keys.
    header = json.loads(
        json.dumps({"format_version": FORMAT_VERSION, "kind": kind, "config": config})
    )
    header["content_sha256"] = _content_sha256(header, stored)
    # Its save_file writes to a temporary file of its own, which a kill would leave.
    content = save(stored, metadata={"loco_drake": json.dumps(header)})
    with atomic_path(Path(path)) as temporary:
        temporary.write_bytes(content)


def load_weights(
    path: Path, kind: str, may_be_nan: Collection[str] = ()
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Returns the tensors and the config of a weights file.

    16-bit tensors are returned in 32 bits. Files of earlier versions have no hash and
    are accepted.

    Args:
        path: the file.
        kind: expected kind of weights.
        may_be_nan: names of the only tensors that may contain NaN.

    Raises:
        InputError: if the file is missing, damaged, or of another kind or version.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"There are no {kind} weights at {str(path)!r}.")
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ValueError("too large")
        with safe_open(path, framework="pt") as file:
            header = parse_json((file.metadata() or {})["loco_drake"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        claimed = header.pop("content_sha256", None)
        types = {name: type(value) for name, value in header.items()}
        if types != {"format_version": int, "kind": str, "config": dict}:
            raise ValueError("another header")
    except Exception:  # safetensors, its Rust and json raise many kinds
        raise InputError(
            f"{path} is damaged or is not a weights file of loco_drake."
        ) from None
    if header["format_version"] != FORMAT_VERSION:
        raise InputError(
            f"{path} has weights format {header['format_version']}; this version reads "
            f"{FORMAT_VERSION}."
        )
    if header["kind"] != kind:
        raise InputError(
            f"{path} holds {header['kind']} weights, but {kind} weights are needed."
        )
    if claimed not in (None, _content_sha256(header, tensors)):
        raise InputError(f"{path} is damaged: its content does not match its hash.")
    for name, value in tensors.items():
        finite = not value.is_floating_point() or value.float().isfinite().all()
        if not finite and name not in may_be_nan:
            raise InputError(f"{path} is damaged: {quoted(name)} is not finite.")
        if value.is_floating_point() and (value.double().abs() > MAX_VALUE).any():
            raise InputError(
                f"{path} is damaged: {quoted(name)} holds numbers beyond {MAX_VALUE:g}."
            )
        # Without a hash, one that was wiped cannot be told from one that was trained to
        # zero. Biases and the optimizer's averages are zero at first.
        network = value.dim() > 1 and not name.startswith("optimizer/")
        if claimed is None and network and not value.any():
            raise InputError(f"{path} is damaged: {quoted(name)} is zero throughout.")
        if value.dtype == torch.float16:
            tensors[name] = value.float()
    return tensors, header["config"]


def kind_of(path: Path) -> str | None:
    """Returns the kind that a weights file claims to hold, None if it claims none."""
    try:
        with safe_open(path, framework="pt") as file:
            header = parse_json((file.metadata() or {})["loco_drake"])
        kind = header["kind"]
    except Exception:  # safetensors, its Rust and json raise many kinds
        return None
    return kind if isinstance(kind, str) else None


def load_into(module: torch.nn.Module, tensors: dict[str, Tensor], path: Path) -> None:
    """Copies ``tensors`` into ``module``.

    Raises:
        InputError: unless names, shapes and types are the module's.
    """
    _check_fit(module, tensors, path)
    module.load_state_dict(tensors)


def read_config(config_class: type[Config], values: Any, path: Path) -> Config:
    """Returns a dataclass from a header's JSON, with each field checked.

    ``BEFORE``, if the dataclass has it, maps former names of fields to their names.

    Raises:
        InputError: if a field is unknown, missing, of the wrong type, or an invalid
            size.
    """
    before = getattr(config_class, "BEFORE", {})
    if isinstance(values, dict):
        values = {before.get(name, name): value for name, value in values.items()}
    try:
        config = convert(values, config_class)
        for name, value in vars(config).items():
            if not _is_size(value):
                raise FieldError(name, "is no size")
    except FieldError as error:
        raise InputError(
            f"{path} has a damaged header: {quoted(error.field)} is wrong."
        ) from None
    return config


def _is_size(value: Any) -> bool:
    """Returns whether integers, and numbers of items, are sizes of a network."""
    if isinstance(value, list | tuple):
        return len(value) <= MAX_SIZE and all(map(_is_size, value))
    return type(value) is not int or 1 <= value <= MAX_SIZE


def build_network(
    path: Path,
    make: Callable[[Config], Network],
    config: Config,
    tensors: dict[str, Tensor],
) -> Network:
    """Returns the network that a header describes, with the weights of the file.

    Allocates memory only after the shapes have been compared with the file.

    Raises:
        InputError: if it cannot be built, or the weights do not fit.
    """
    try:
        with torch.device("meta"):
            planned = make(config)
    except Exception:  # torch raises many kinds for inconsistent sizes
        raise InputError(
            f"{path} has a damaged header: no network can be built from it."
        ) from None
    _check_fit(planned, tensors, path)
    network = make(config)
    network.load_state_dict(tensors)
    return network


def save_network(
    path: Path,
    kind: str,
    network: Any,
    info: Mapping[str, Any] | None = None,
    *,
    half: bool = False,
) -> None:
    """Writes a network for :func:`load_network`; see :func:`save_weights`.

    The module has a dataclass ``config``; ``info`` is JSON for readers of the header.
    """
    config = {"network": asdict(network.config), "info": info or {}}
    save_weights(path, kind, network.state_dict(), config, half=half)


def load_network(
    path: Path,
    kind: str,
    make: Callable[[Config], Network],
    config_class: type[Config],
) -> Network:
    """Returns the network that :func:`save_network` wrote, ready for inference.

    Raises:
        InputError: if the file is missing, damaged, or of another kind.
    """
    tensors, config = load_weights(path, kind)
    network_config = read_config(config_class, config.get("network"), path)
    network = build_network(path, make, network_config, tensors)
    return network.eval().requires_grad_(False)


def _check_fit(module: torch.nn.Module, tensors: dict[str, Tensor], path: Path) -> None:
    own, given = (
        {name: (value.shape, value.dtype) for name, value in of.items()}
        for of in (module.state_dict(), tensors)
    )
    if own != given:
        raise InputError(
            f"The weights in {path} do not fit the network that their header describes."
        )


def _content_sha256(header: dict[str, Any], tensors: dict[str, Tensor]) -> str:
    return content_sha256(
        header,
        {
            f"{name} {value.dtype} {tuple(value.shape)}": value.reshape(-1)
            .view(torch.uint8)
            .numpy()
            .tobytes()
            for name, value in tensors.items()
        },
    )
