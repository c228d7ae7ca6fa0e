"""Ways to damage zip archives of arrays: records, members and array headers."""

import functools
import io
import struct
import zipfile
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.fuzzing.damage import Damage, Random

Members = dict[str, bytes]


def to_npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def from_npy(data: bytes) -> np.ndarray:
    return np.load(io.BytesIO(data))


def to_zip(members: Members, method: int = zipfile.ZIP_DEFLATED) -> bytes:
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


def zip_records(data: bytes, members: Members) -> Iterator[Damage]:
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
        packed = to_zip(members, method)
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
    data = to_zip({**members, name: b""})
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


def zip_members(members: Members) -> Iterator[Damage]:
    for name, data in members.items():
        rest = {k: v for k, v in members.items() if k != name}
        yield Damage(f"without {name}", to_zip(rest))
        yield Damage(f"{name} renamed", to_zip({**rest, name.upper(): data}))
        yield Damage(f"{name} cut", to_zip({**members, name: data[:-3]}))
        yield Damage(f"{name} is text", to_zip({**members, name: b"text"}))
        yield Damage(f"{name} is empty", to_zip({**members, name: b""}))
        yield Damage(f"{name} is pickled", to_zip({**members, name: b"\x80\x04N."}))
        yield Damage(
            f"{name} with garbage behind", to_zip({**members, name: data + b"xx"})
        )
    whole = next(iter(members.values()))
    for other in (
        "../canary.npy",
        "/tmp/loco_drake_canary.npy",
        "a\nb.npy",
        "x" * 9999,
        "extra",
    ):
        yield Damage(f"a member {other[:20]!r} more", to_zip({**members, other: whole}))
    spaced = to_zip({f"{name} ": data for name, data in members.items()})
    twice = to_zip(
        {**members, **{f"{name} ": data[:-1] for name, data in members.items()}}
    )
    yield Damage("zero bytes in names", spaced.replace(b".npy ", b".npy\x00"))
    yield Damage("spaces in names", spaced)
    yield Damage("members twice", twice.replace(b".npy ", b".npy\x00"))
    yield Damage("no members", to_zip({}))
    yield Damage(
        "10,000 members", to_zip({**members, **{f"m{k}": b"" for k in range(10_000)}})
    )
    yield Damage("an archive in an archive", to_zip({"motion.npz": to_zip(members)}))
    for name in ("base_position.npy", "header.npy", "other.npy"):
        for gigabytes, shape in ((3, 3 * 2**30 // 24), (3, 100), (8, 2**60)):
            new = _bomb(members, name, gigabytes, shape)
            yield Damage(f"{gigabytes} GB in {name}, {shape} rows", new)


def array_headers(members: Members, random: Random) -> Iterator[Damage]:
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
        yield Damage(f"{name}: {what}", to_zip({**members, name: new}))
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
        yield Damage(f"{name}: header {what}", to_zip({**members, name: new}))
    for version in (0, 2, 3, 4, 255):
        name = names[int(random.integers(len(names)))]
        data = members[name]
        new = data[:6] + bytes([version]) + data[7:]
        yield Damage(f"{name}: version {version}", to_zip({**members, name: new}))
        new = data[:8] + struct.pack("<H", 0xFFFF) + data[10:]
        yield Damage(f"{name}: length of the header", to_zip({**members, name: new}))


def _with_header(data: bytes, edit: Any) -> bytes:
    file = io.BytesIO(data)
    np.lib.format.read_magic(file)
    shape, order, dtype = np.lib.format.read_array_header_1_0(file)
    header = {"descr": dtype.str, "fortran_order": order, "shape": shape}
    text = edit(header).encode() + b"\n"
    head = b"\x93NUMPY\x02\x00" + struct.pack("<I", len(text))
    return head + text + file.read()
