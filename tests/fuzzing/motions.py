"""Ways to damage Motion files: their archive, arrays and header."""

import io
import json
import zipfile
from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.fuzzing.archives import (
    Members,
    array_headers,
    from_npy,
    to_npy,
    to_zip,
    zip_members,
    zip_records,
)
from tests.fuzzing.damage import CHECKSUM, DEEP, Damage, Random
from tests.fuzzing.text import replaced


def npz_files(data: bytes, random: Random) -> Iterator[Damage]:
    """Yields Motion files whose archive, members or header were edited."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    yield from zip_records(data, members)
    yield from zip_members(members)
    yield from array_headers(members, random)
    header = json.loads(str(from_npy(members["header.npy"])))
    for damage in _arrays(members, random):
        yield Damage(f"signed, {damage.what}", damage.data)
    # Older files, and those of other programs, have no checksum.
    header.pop(CHECKSUM, None)
    members = {**members, **_header(header)}
    yield from _arrays(members, random)
    for what, changed in replaced(header, 250, random):
        # Another name of a gait or a source is another motion's, and any text is one.
        named = what.endswith((" is a text", " is a number as text"))
        legal = what.startswith("provenance") or (
            named and what.startswith(("gait ", "source "))
        )
        data = to_zip({**members, **_header(changed)})
        yield Damage(f"header: {what}", data, legal=legal)
    for what, text in (
        ("deep", DEEP),
        ("deep objects", '{"a":' * 100_000),
        ("a list", "[]"),
        ("no JSON", "text"),
        ("empty", ""),
        ("huge integer", '{"schema_version": ' + "1" * 100_000 + "}"),
    ):
        new = {**members, "header.npy": to_npy(np.array(text))}
        yield Damage(f"header {what}", to_zip(new))
    array = np.array(json.dumps(header))
    for what, value in (
        ("two headers", np.array([array, array])),
        ("header of bytes", np.array(json.dumps(header).encode())),
        ("header of a number", np.array(3.0)),
        ("header with zero bytes", np.array("\x00" + str(array))),
    ):
        yield Damage(what, to_zip({**members, "header.npy": to_npy(value)}))
    nan = json.dumps(header).replace(str(header["fps"]), "NaN", 1)
    yield Damage(
        "header with NaN", to_zip({**members, "header.npy": to_npy(np.array(nan))})
    )


def _header(value: Any) -> Members:
    return {"header.npy": to_npy(np.array(json.dumps(value)))}


def _arrays(members: Members, random: Random) -> Iterator[Damage]:
    for name, data in members.items():
        if name == "header.npy":
            continue
        array = from_npy(data)
        for what, new in _changed(array, random):
            data = to_zip({**members, name: to_npy(new)})
            near = _like_measured(name, what, array, new)
            yield Damage(f"{name}: {what}", data, near=near)
    short = {
        name: to_npy(from_npy(data)[:1]) if name != "header.npy" else data
        for name, data in members.items()
    }
    yield Damage("one frame", to_zip(short))
    none = {
        name: to_npy(from_npy(data)[:0]) if name != "header.npy" else data
        for name, data in members.items()
    }
    yield Damage("no frames", to_zip(none))


def _like_measured(name: str, what: str, array: np.ndarray, new: np.ndarray) -> bool:
    """Returns whether no reader can tell an array from one that was measured.

    Without a checksum that is an array rounded to 32 bits, which other programs write,
    or in the sixth decimal; whether one foot stood in one frame; and velocities within
    a hundredth of the highest, as differences of positions are themselves no nearer.
    What comes of it must be near what comes of the sound file.
    """
    if what in ("as f4", "one the other way", "1e-6 more once"):
        return True
    same = array.shape == new.shape and array.dtype == new.dtype
    if "velocit" not in name or not same:
        return False
    return bool(np.abs(new - array).max() <= 0.01 * np.abs(array).max())


def _changed(array: np.ndarray, random: Random) -> Iterator[tuple[str, np.ndarray]]:
    if array.dtype == bool:
        yield "as numbers", array.astype(float)
        yield "as bytes", array.astype(np.uint8)
        yield "the other way", ~array
        yield "one the other way", _set(array, lambda v: not v, random)
        yield "short", array[:-1]
        yield "twice as wide", np.concatenate((array, array), axis=1)
        return
    for kind in ("f4", "f2", "longdouble", "c16", "i8", "U20", "S20", "O"):
        if kind != "O":
            yield f"as {kind}", array.astype(kind)
    for what, change in (
        ("NaN", lambda v: np.nan),
        ("infinity", lambda v: -np.inf),
        ("1e300", lambda v: 1e300),
        ("1e-320", lambda v: 1e-320),
        ("half more", lambda v: v + 0.5),
        ("ten more", lambda v: v + 10.0),
        ("1e-6 more", lambda v: v + 1e-6),
        ("the other sign", lambda v: -v),
    ):
        yield f"{what} once", _set(array, change, random)
    yield "all zero", array * 0
    yield "in degrees", np.degrees(array)
    yield "the other sign", -array
    yield "turned round", array[::-1]
    yield "columns turned round", array[:, ::-1]
    yield "short", array[:-1]
    yield "long", np.concatenate((array, array[-1:]))
    yield "transposed", array.T
    yield "a column less", array[:, :-1]
    yield "three dimensions", array[None]
    yield "frames shifted", np.roll(array, 7, axis=0)
    yield "noise", array + 0.2 * random.normal(size=array.shape)
    yield "empty", array[:, :0]


def _set(array: np.ndarray, change: Any, random: Random) -> np.ndarray:
    new = array.copy()
    at = tuple(int(random.integers(n)) for n in array.shape)
    new[at] = change(new[at])
    return new
