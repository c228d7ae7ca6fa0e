"""Ways to damage weights and checkpoints (safetensors)."""

import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.fuzzing.damage import CHECKSUM, DEEP, Damage, Random
from tests.fuzzing.text import replaced


def safetensors_files(data: bytes, random: Random) -> Iterator[Damage]:
    """Yields weights whose header, tensors or description were edited."""
    size = struct.unpack("<Q", data[:8])[0]
    header, body = json.loads(data[8 : 8 + size]), data[8 + size :]
    for damage in _tensors(header, body, random):
        yield Damage(f"signed, {damage.what}", damage.data)
    # Files of earlier versions have no checksum.
    about = dict(header["__metadata__"])
    told = json.loads(about["loco_drake"])
    told.pop(CHECKSUM, None)
    header["__metadata__"] = {**about, "loco_drake": json.dumps(told)}
    names = [name for name in header if name != "__metadata__"]

    def whole(header: Any, body: bytes = body) -> bytes:
        text = header if isinstance(header, bytes) else json.dumps(header).encode()
        return struct.pack("<Q", len(text)) + text + body

    for length in (0, 1, size - 1, size + 1, 2**31, 2**63, 2**64 - 1, 100_000_001):
        yield Damage(f"header of {length} bytes", struct.pack("<Q", length) + data[8:])
    yield Damage("header deep", whole(DEEP.encode()))
    yield Damage("header a list", whole(b"[]"))
    yield Damage("header empty", whole(b"{}"))
    yield Damage("header with spaces", whole(b" " * 8 + json.dumps(header).encode()))
    yield Damage("header not UTF-8", whole(b'{"\xff": 1}'))
    picked = [names[int(k)] for k in random.permutation(len(names))[:6]]
    for name in picked:
        own = header[name]
        start, end = own["data_offsets"]
        edits: dict[str, Any] = {
            f"type {kind}": {**own, "dtype": kind}
            for kind in (
                "F64",
                "F16",
                "BF16",
                "I32",
                "I64",
                "U8",
                "BOOL",
                "F8_E4M3",
                "X",
                7,
            )
        }
        edits |= {
            f"shape {str(shape)[:30]}": {**own, "shape": shape}
            for shape in (
                [],
                [0],
                [-1],
                own["shape"][::-1],
                [int(np.prod(own["shape"]))],
                [*own["shape"], 1],
                [2**62, 4],
                "text",
                [1.5],
            )
        }
        edits |= {
            f"offsets {offsets}": {**own, "data_offsets": offsets}
            for offsets in (
                [end, start],
                [0, 0],
                [start + 4, end + 4],
                [start, 2**62],
                [-4, end],
                [start],
                "text",
                [0, end - start],
            )
        }
        edits |= {"null": None, "a text": "text", "a field more": {**own, "more": 1}}
        for what, edit in edits.items():
            yield Damage(f"{name}: {what}", whole({**header, name: edit}))
        rest = {k: v for k, v in header.items() if k != name}
        yield Damage(f"{name} renamed", whole({**rest, "other": own}))
        yield Damage(f"{name} missing", whole(rest))
    a, b = picked[:2]
    yield Damage(
        f"{a} and {b} exchanged", whole({**header, a: header[b], b: header[a]})
    )
    yield from _tensors(header, body, random)
    about = header.get("__metadata__", {})
    for key, text in about.items():
        for new in ("", "text", "null", "[]", "{}", DEEP, "1" * 5000, "\x00"):
            changed = {**about, key: new}
            yield Damage(
                f"{key} is {new[:9]!r}", whole({**header, "__metadata__": changed})
            )
        try:
            value = json.loads(text)
        except ValueError:
            continue
        for what, changed_value in replaced(value, 150, random):
            changed = {**about, key: json.dumps(changed_value)}
            new_header = {**header, "__metadata__": changed}
            # One state of a generator of random numbers is as good as another, as
            # long as it is one.
            valid = (" is zero", " is one", " is a huge number")
            legal = "random" in what.split(" ")[0] and what.endswith(valid)
            yield Damage(f"{key}: {what}", whole(new_header), legal=legal)
    for new in (None, [], "text", {"loco_drake": 1}, {}, {"other": "x"}):
        yield Damage(f"metadata {new!r}", whole({**header, "__metadata__": new}))


_TYPES = {
    "F32": "<f4",
    "F16": "<f2",
    "F64": "<f8",
    "I64": "<i8",
    "U8": "u1",
    "I32": "<i4",
}


def _tensors(header: dict[str, Any], body: bytes, random: Random) -> Iterator[Damage]:
    """Yields weights of which the values of a tensor, or its type, are others.

    Without a checksum nobody can tell one value from another that a training may find,
    nor 32 bits from 16, in which weights are shipped.
    """
    names = [name for name in header if name != "__metadata__"]
    floats = [n for n in names if header[n]["dtype"] in ("F32", "F16")]
    for name in [floats[int(k)] for k in random.permutation(len(floats))[:4]]:
        own = header[name]
        start, end = own["data_offsets"]
        values = np.frombuffer(body[start:end], _TYPES[own["dtype"]])
        at = int(random.integers(len(values)))
        for what, change in (
            ("NaN", np.nan),
            ("infinity", np.inf),
            ("1e30", 1e30),
            ("zero", 0.0),
            ("a little more", values[at] * 1.01 + 1e-3),
        ):
            new = values.copy()
            with np.errstate(over="ignore"):
                new[at] = change
            data = body[:start] + new.tobytes() + body[end:]
            new_file = _weights(header, data)
            legal = abs(float(change)) < 1e6
            yield Damage(f"{name}: {what} once", new_file, legal=legal)
        data = body[:start] + bytes(end - start) + body[end:]
        legal = len(own["shape"]) < 2 or name.startswith("optimizer/")
        yield Damage(f"{name}: all zero", _weights(header, data), legal=legal)
        for kind in ("F64", "F16", "I64", "U8", "F32"):
            if kind == own["dtype"]:
                continue
            with np.errstate(invalid="ignore", over="ignore"):
                cast = values.astype(_TYPES[kind]).tobytes()
            new_file = _weights(*_moved(header, body, name, kind, cast))
            legal = kind == "F16"
            yield Damage(f"{name}: cast to {kind}", new_file, legal=legal)


def _moved(
    header: dict[str, Any], body: bytes, name: str, kind: str, new: bytes
) -> tuple[dict[str, Any], bytes]:
    """Returns header and data with other data of one tensor."""
    start, end = header[name]["data_offsets"]
    shift = len(new) - (end - start)
    moved = {}
    for key, own in header.items():
        if key == name:
            own = {**own, "dtype": kind, "data_offsets": [start, start + len(new)]}
        elif key != "__metadata__" and own["data_offsets"][0] >= end:
            a, b = own["data_offsets"]
            own = {**own, "data_offsets": [a + shift, b + shift]}
        moved[key] = own
    return moved, body[:start] + new + body[end:]


def _weights(header: dict[str, Any], body: bytes) -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + body
