"""Ways to damage Motion files (zip archives of arrays) and weights (safetensors)."""

import functools
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.fuzzing.damage import DEEP, Damage, Random
from tests.fuzzing.text import replaced

Members = dict[str, bytes]

CHECKSUM = "content_sha256"


def npz_files(data: bytes, random: Random) -> Iterator[Damage]:
    """Yields Motion files whose archive, members or header were edited."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    yield from _zip_records(data, members)
    yield from _zip_members(members)
    yield from _npy_headers(members, random)
    header = json.loads(str(_array(members["header.npy"])))
    for damage in _arrays(members, random):
        yield Damage(f"signed, {damage.what}", damage.data)
    # Older files, and those of other programs, have no checksum.
    header.pop(CHECKSUM, None)
    members = {**members, **_header(header)}
    yield from _arrays(members, random)
    for what, changed in replaced(header, 250, random):
        named = what.startswith(("gait ", "source ", "provenance"))
        data = _zip({**members, **_header(changed)})
        yield Damage(f"header: {what}", data, legal=named)
    for what, text in (
        ("deep", DEEP),
        ("deep objects", '{"a":' * 100_000),
        ("a list", "[]"),
        ("no JSON", "text"),
        ("empty", ""),
        ("huge integer", '{"schema_version": ' + "1" * 100_000 + "}"),
    ):
        new = {**members, "header.npy": _npy(np.array(text))}
        yield Damage(f"header {what}", _zip(new))
    array = np.array(json.dumps(header))
    for what, value in (
        ("two headers", np.array([array, array])),
        ("header of bytes", np.array(json.dumps(header).encode())),
        ("header of a number", np.array(3.0)),
        ("header with zero bytes", np.array("\x00" + str(array))),
    ):
        yield Damage(what, _zip({**members, "header.npy": _npy(value)}))
    nan = json.dumps(header).replace(str(header["fps"]), "NaN", 1)
    yield Damage(
        "header with NaN", _zip({**members, "header.npy": _npy(np.array(nan))})
    )


def _header(value: Any) -> Members:
    return {"header.npy": _npy(np.array(json.dumps(value)))}


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _array(data: bytes) -> np.ndarray:
    return np.load(io.BytesIO(data))


def _zip(members: Members, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data, method)
    return file.getvalue()


# Fields of the local and of the central record: name, format, offset in each.
_FIELDS = {
    "flags": ("<H", 6, 8),
    "method": ("<H", 8, 10),
    "checksum": ("<I", 14, 16),
    "packed size": ("<I", 18, 20),
    "size": ("<I", 22, 24),
    "length of the name": ("<H", 26, 28),
    "length of extras": ("<H", 28, 30),
}
_NEW = {
    "flags": (1, 8, 32, 64, 0x800, 0x2041, 0xFFFF),
    "method": (0, 1, 2, 6, 7, 9, 10, 12, 14, 19, 93, 95, 96, 97, 98, 99, 0xFFFF),
    "checksum": (0, 0xFFFFFFFF),
    "packed size": (0, 1, 0x7FFFFFFF, 0xFFFFFFFF),
    "size": (0, 1, 0x7FFFFFFF, 0xFFFFFFFF),
    "length of the name": (0, 1, 0xFFFF),
    "length of extras": (1, 20, 0xFFFF),
}


def _zip_records(data: bytes, members: Members) -> Iterator[Damage]:
    for name, (form, local, central) in _FIELDS.items():
        for value in _NEW[name]:
            for where in ("first", "all", "central only"):
                new = bytearray(data)
                for mark, offset in ((b"PK\x03\x04", local), (b"PK\x01\x02", central)):
                    if where == "central only" and mark == b"PK\x03\x04":
                        continue
                    at = new.find(mark)
                    while at >= 0:
                        struct.pack_into(form, new, at + offset, value)
                        at = new.find(mark, at + 4) if where != "first" else -1
                yield Damage(f"{name} {value} in {where}", bytes(new))
    end = data.rfind(b"PK\x05\x06")
    for what, offset, value in (
        ("members counted", 10, 0xFFFF),
        ("no members counted", 10, 0),
        ("size of the directory", 12, 0xFFFFFFFF),
        ("place of the directory", 16, 0xFFFFFFF0),
        ("a disk number", 4, 7),
        ("a comment's length", 20, 1000),
    ):
        new = bytearray(data)
        struct.pack_into(
            "<H" if offset < 12 or offset == 20 else "<I", new, end + offset, value
        )
        yield Damage(f"end record: {what}", bytes(new))
    for method, what in (
        (zipfile.ZIP_LZMA, "lzma"),
        (zipfile.ZIP_BZIP2, "bzip2"),
        (zipfile.ZIP_STORED, "stored"),
    ):
        packed = _zip(members, method)
        yield Damage(f"packed by {what}", packed)
        for at in range(200, len(packed), len(packed) // 5):
            new = packed[:at] + b"\xff\x00\xff" + packed[at + 3 :]
            yield Damage(f"packed by {what}, bytes {at} damaged", new)


@functools.cache
def _zeros(gigabytes: int) -> bytes:
    """Returns so many GB of zeros, packed."""
    pack = zlib.compressobj(9, zlib.DEFLATED, -15)
    chunk = bytes(2**24)
    head = pack.compress(chunk) + pack.flush(zlib.Z_FULL_FLUSH)
    again = pack.compress(chunk) + pack.flush(zlib.Z_FULL_FLUSH)
    return head + again * (64 * gigabytes - 1) + pack.flush()


def _bomb(members: Members, name: str, gigabytes: int, shape: int) -> bytes:
    """Returns an archive whose member ``name`` unpacks to GB."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": (shape, 3)}
    )
    pack = zlib.compressobj(9, zlib.DEFLATED, -15)
    begin = pack.compress(head.getvalue()) + pack.flush(zlib.Z_FULL_FLUSH)
    body = begin + _zeros(gigabytes)
    data = _zip({**members, name: b""})
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        infos = archive.infolist()
    out, directory = bytearray(), bytearray()
    for info in infos:
        raw = body if info.filename == name else None
        if raw is None:
            plain = members[info.filename]
            packer = zlib.compressobj(9, zlib.DEFLATED, -15)
            raw, size = packer.compress(plain) + packer.flush(), len(plain)
            crc = zlib.crc32(plain)
        else:
            size, crc = min(len(head.getvalue()) + gigabytes * 2**30, 2**32 - 2), 0
        label = info.filename.encode()
        place = len(out)
        fields = (20, 0, 8, 0, 33, crc, len(raw), size, len(label), 0)
        out += struct.pack("<4s5H3I2H", b"PK\x03\x04", *fields) + label + raw
        directory += struct.pack(
            "<4s6H3I5H2I", b"PK\x01\x02", 20, *fields, 0, 0, 0, 0, place
        )
        directory += label
    count, place = len(infos), len(out)
    end = struct.pack(
        "<4s4H2IH", b"PK\x05\x06", 0, 0, count, count, len(directory), place, 0
    )
    return bytes(out + directory + end)


def _zip_members(members: Members) -> Iterator[Damage]:
    for name, data in members.items():
        rest = {k: v for k, v in members.items() if k != name}
        yield Damage(f"without {name}", _zip(rest))
        yield Damage(f"{name} renamed", _zip({**rest, name.upper(): data}))
        yield Damage(f"{name} cut", _zip({**members, name: data[:-3]}))
        yield Damage(f"{name} is text", _zip({**members, name: b"text"}))
        yield Damage(f"{name} is empty", _zip({**members, name: b""}))
        yield Damage(f"{name} is pickled", _zip({**members, name: b"\x80\x04N."}))
        yield Damage(
            f"{name} with garbage behind", _zip({**members, name: data + b"xx"})
        )
    whole = next(iter(members.values()))
    for other in (
        "../canary.npy",
        "/tmp/loco_drake_canary.npy",
        "a\nb.npy",
        "x" * 9999,
        "extra",
    ):
        yield Damage(f"a member {other[:20]!r} more", _zip({**members, other: whole}))
    spaced = _zip({f"{name} ": data for name, data in members.items()})
    twice = _zip(
        {**members, **{f"{name} ": data[:-1] for name, data in members.items()}}
    )
    yield Damage("zero bytes in names", spaced.replace(b".npy ", b".npy\x00"))
    yield Damage("spaces in names", spaced)
    yield Damage("members twice", twice.replace(b".npy ", b".npy\x00"))
    yield Damage("no members", _zip({}))
    yield Damage(
        "10,000 members", _zip({**members, **{f"m{k}": b"" for k in range(10_000)}})
    )
    yield Damage("an archive in an archive", _zip({"motion.npz": _zip(members)}))
    for name in ("base_position.npy", "header.npy", "other.npy"):
        for gigabytes, shape in ((3, 3 * 2**30 // 24), (3, 100), (8, 2**60)):
            new = _bomb(members, name, gigabytes, shape)
            yield Damage(f"{gigabytes} GB in {name}, {shape} rows", new)


def _npy_headers(members: Members, random: Random) -> Iterator[Damage]:
    names = [name for name in members if name != "header.npy"]
    edits = {
        "objects": {"descr": "|O"},
        "big-endian": {"descr": ">f8"},
        "integers": {"descr": "<i8"},
        "complex": {"descr": "<c16"},
        "text": {"descr": "<U2"},
        "no type": {"descr": "|V8"},
        "unknown": {"descr": "<x8"},
        "fields": {"descr": [("a", "<f4"), ("b", "<f4")]},
        "dates": {"descr": "<M8[s]"},
        "not text": {"descr": 7},
        "by columns": {"fortran_order": True},
        "order of text": {"fortran_order": "yes"},
        "huge": {"shape": (2**40, 3)},
        "beyond huge": {"shape": (2**62, 2**62)},
        "negative": {"shape": (-1, 3)},
        "flat": {"shape": (300,)},
        "one number": {"shape": ()},
        "of text": {"shape": "text"},
        "fractions": {"shape": (1.5, 3)},
        "64 dimensions": {"shape": (1,) * 65},
        "a true one": {"shape": (True, 3)},
    }
    for what, edit in edits.items():
        name = names[int(random.integers(len(names)))]
        new = _with_header(members[name], lambda h, e=edit: repr({**h, **e}))
        yield Damage(f"{name}: {what}", _zip({**members, name: new}))
    texts = {
        "deep": lambda h: "(" * 60_000 + ")" * 60_000,
        "a call": lambda h: "__import__('os').system('touch canary')",
        "a key more": lambda h: repr({**h, "more": 1}),
        "a key less": lambda h: "{'descr': '<f8'}",
        "a list": lambda h: "[1]",
        "no Python": lambda h: "{'descr': ",
        "zero bytes": lambda h: "\x00" + repr(h),
        "long": lambda h: repr(h) + " " * 60_000,
        "long integers": lambda h: repr(h).replace("(", "(" + "9L, "),
        "indented": lambda h: "  " + repr(h),
    }
    for what, edit in texts.items():
        name = names[int(random.integers(len(names)))]
        new = _with_header(members[name], edit)
        yield Damage(f"{name}: header {what}", _zip({**members, name: new}))
    for version in (0, 2, 3, 4, 255):
        name = names[int(random.integers(len(names)))]
        data = members[name]
        new = data[:6] + bytes([version]) + data[7:]
        yield Damage(f"{name}: version {version}", _zip({**members, name: new}))
        new = data[:8] + struct.pack("<H", 0xFFFF) + data[10:]
        yield Damage(f"{name}: length of the header", _zip({**members, name: new}))


def _with_header(data: bytes, edit: Any) -> bytes:
    file = io.BytesIO(data)
    np.lib.format.read_magic(file)
    shape, order, dtype = np.lib.format.read_array_header_1_0(file)
    header = {"descr": dtype.str, "fortran_order": order, "shape": shape}
    text = edit(header).encode() + b"\n"
    head = b"\x93NUMPY\x02\x00" + struct.pack("<I", len(text))
    return head + text + file.read()


def _arrays(members: Members, random: Random) -> Iterator[Damage]:
    for name, data in members.items():
        if name == "header.npy":
            continue
        array = _array(data)
        for what, new in _changed(array, random):
            # Nobody can tell how the feet felt, a velocity from one that is near, or
            # 64 bits from 32, which the reader takes as well.
            legal = what in ("noise", "as f4") or (
                array.shape == new.shape
                and (array.dtype == new.dtype == bool or _below_noise(name, array, new))
            )
            data = _zip({**members, name: _npy(new)})
            yield Damage(f"{name}: {what}", data, legal=legal)
    short = {
        name: _npy(_array(data)[:1]) if name != "header.npy" else data
        for name, data in members.items()
    }
    yield Damage("one frame", _zip(short))
    none = {
        name: _npy(_array(data)[:0]) if name != "header.npy" else data
        for name, data in members.items()
    }
    yield Damage("no frames", _zip(none))


def _below_noise(name: str, array: np.ndarray, new: np.ndarray) -> bool:
    """Returns whether velocities are within a hundredth of the highest of them."""
    if "velocit" not in name or array.dtype != new.dtype:
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


Tensors = dict[str, tuple[str, list[int], bytes]]


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
            # One state of a generator of random numbers is as good as another.
            legal = ".random." in what or "_random" in what
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

    Without a checksum nobody can tell one finite value from another.
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
            legal = bool(np.isfinite(change))
            yield Damage(f"{name}: {what} once", new_file, legal=legal)
        data = body[:start] + bytes(end - start) + body[end:]
        yield Damage(f"{name}: all zero", _weights(header, data), legal=True)
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
