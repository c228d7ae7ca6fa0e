"""Reads and writes recorded drives: JSON lines, a header and then the orders."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake import __version__
from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, quoted
from loco_drake.common.files import atomic_path, content_sha256, parse_json, read_text
from loco_drake.control.driving import (
    COLUMNS,
    GAIT,
    OrderTable,
    check_orders,
    order_table,
)
from loco_drake.motion.gaits import gait_name

_KIND = "loco_drake drive"
_SCHEMA_VERSION = 1
# What a header holds beside kind, version and hash, and the types of it.
_FIELDS: dict[str, type] = {
    "robot": str,
    "gait": str,  # at the beginning
    "seed": int,
    "scenario": str,  # YAML
    "policy_sha256": str,  # of the weights file
    "steps": int,  # control periods that were simulated
    "states_sha256": str,  # see states_sha256
    "loco_drake": str,  # version that wrote the file
}
# The same, which earlier files lack.
_LATER: dict[str, type] = {"tokenizer_sha256": str, "generator_sha256": str}


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive that was recorded."""

    header: Mapping[str, Any]  # see _FIELDS
    table: OrderTable


def save_drive(path: Path, table: OrderTable, **header: Any) -> None:
    """Writes a drive, atomically.

    Args:
        path: the file.
        table: the orders.
        header: the fields of a header, but for the version.
    """
    lines = []
    for time, row in zip(table.times, table.rows, strict=True):
        orders: list[Any] = [float(value) for value in row]
        orders[GAIT] = gait_name(int(row[GAIT]))
        lines.append(json.dumps([float(time), *orders]))
    content = "\n".join(lines)
    fields = {**header, "loco_drake": __version__}
    full = {
        "kind": _KIND,
        "schema_version": _SCHEMA_VERSION,
        **{name: fields[name] for name in _FIELDS},
        **{name: fields[name] for name in _LATER if name in fields},
        "columns": list(COLUMNS),
    }
    full["content_sha256"] = content_sha256(full, {"rows": content.encode()})
    with atomic_path(path) as temporary:
        temporary.write_text(f"{json.dumps(full)}\n{content}\n")


def load_drive(path: Path) -> Drive:
    """Reads a recorded drive and checks it.

    Raises:
        InputError: if the file cannot be read, is no drive, of a newer schema, cut off
            or changed.
    """
    first, _, content = read_text(path).partition("\n")
    try:
        header = parse_json(first)
    except ValueError:
        header = {}
    if header.get("kind") != _KIND:
        raise InputError(f"{path} is not a drive that loco-drake drive recorded.")
    if header.get("schema_version") != _SCHEMA_VERSION:
        raise InputError(
            f"{path} has the schema {quoted(header.get('schema_version'))}; this "
            f"version of loco_drake reads {_SCHEMA_VERSION}."
        )
    claimed = header.pop("content_sha256", None)
    content = content.removesuffix("\n")
    if claimed != content_sha256(header, {"rows": content.encode()}):
        raise InputError(
            f"{path} is damaged: it was cut off or changed, and does not match its "
            "hash."
        )
    try:
        for name, kind in (_FIELDS | _LATER).items():
            if name in _LATER and name not in header:
                continue
            if type(header.get(name)) is not kind:
                raise InputError(f"its header lacks {name}.")
        if header.get("columns") != list(COLUMNS):
            raise InputError(f"its columns must be {', '.join(COLUMNS)}.")
        table = _table(content)
    except (InputError, TypeError, ValueError, RecursionError) as error:
        reason = str(error) if isinstance(error, InputError) else "a row is amiss."
        raise InputError(f"{path} is not a sound drive: {reason}") from None
    return Drive(header, table)


def _table(content: str) -> OrderTable:
    rows = [json.loads(line) for line in content.split("\n")]
    if not all(isinstance(r, list) and len(r) == len(COLUMNS) for r in rows):
        raise InputError(f"each row must have {len(COLUMNS)} values.")
    return order_table([r[0] for r in rows], [check_orders(r[1:]) for r in rows])


def states_sha256(states: Array) -> str:
    """Returns a hash of states that tells the last bit, shape (N, n)."""
    return content_sha256(
        {"shape": list(states.shape)},
        {"states": np.ascontiguousarray(states).tobytes()},
    )
