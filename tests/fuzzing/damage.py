"""Ways to damage a file: its bytes, and where it lies."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

Random = np.random.Generator

CHECKSUM = "content_sha256"  # name of the field, in files of every kind


@dataclass(frozen=True)
class Damage:
    """One damaged file.

    Attributes:
        what: was done to it.
        data: its bytes now.
        place: puts something else at its path, instead of a file with ``data``.
        legal: whether the file is another, but sound: nobody can tell.
        near: whether what comes of it must be near what comes of the sound file.
        name: of the file, where that is what is wrong.
    """

    what: str
    data: bytes = b""
    place: Callable[[Path], None] | None = field(default=None, compare=False)
    legal: bool = False
    near: bool = False
    name: str | None = None


def damage_bytes(data: bytes, random: Random) -> Damage:
    """Damages any file, at a place drawn at random; small changes most often."""
    size = len(data)
    a = int(random.integers(size))
    n = min(int(random.choice([1, 2, 4, 16, 100, 1000])), size - a)
    b = int(random.integers(size))
    match int(random.integers(12)):
        case 0 | 1 | 2 | 3:
            return Damage(f"bit flipped in byte {a}", flip(data, a, random))
        case 4:
            many = data
            for at in random.integers(size, size=8):
                many = flip(many, int(at), random)
            return Damage("8 bits flipped", many)
        case 5:
            new = data[:a] + bytes(n) + data[a + n :]
            return Damage(f"{n} bytes zeroed at {a}", new)
        case 6:
            return Damage(f"{n} bytes left out at {a}", data[:a] + data[a + n :])
        case 7:
            return Damage(f"{n} bytes doubled at {a}", data[: a + n] + data[a:])
        case 8:
            return Damage(f"cut after {a} bytes", data[:a])
        case 9:
            new = data[:a] + random.bytes(n) + data[a + n :]
            return Damage(f"{n} random bytes at {a}", new)
        case 10:
            a, b = sorted((a, b))
            return Damage(f"bytes {a} to {b} left out", data[:a] + data[b:])
        case _:
            a, b = sorted((a, b))
            n = min(n, b - a, size - b)
            new = data[:a] + data[b : b + n] + data[a + n : b] + data[a : a + n]
            return Damage(f"{n} bytes exchanged, {a} and {b}", new + data[b + n :])


def flip(data: bytes, at: int, random: Random) -> bytes:
    """Returns ``data`` with one bit of byte ``at`` flipped."""
    return data[:at] + bytes([data[at] ^ 1 << int(random.integers(8))]) + data[at + 1 :]


def _link(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(10**12)


def hand_made(data: bytes, name: str) -> Iterator[Damage]:
    """Yields what every kind of file can suffer.

    Args:
        data: the sound file.
        name: its name.
    """
    suffix = name.rsplit(".", 1)[1]
    yield Damage("empty")
    yield Damage("one byte", data[:1])
    yield Damage("last byte missing", data[:-1])
    yield Damage("half", data[: len(data) // 2])
    yield Damage("twice", data + data)
    yield Damage("garbage behind", data + b"\x00\xffgarbage\n")
    yield Damage("garbage before", b"\x00\xffgarbage\n" + data)
    yield Damage("zeros", bytes(len(data)))
    yield Damage("a picture", b"\x89PNG\r\n\x1a\n" + data[:5000])
    yield Damage("binary", np.random.default_rng(1).bytes(5000))
    yield Damage("compressed", b"\x1f\x8b\x08\x00" + data)
    for what, target in (
        ("link to nothing", "nowhere"),
        ("link to itself", name),
        ("link to a folder", "."),
        ("link to /dev/zero", "/dev/zero"),
        ("link to /dev/null", "/dev/null"),
        ("link to /dev/full", "/dev/full"),
        ("link to /proc/self/mem", "/proc/self/mem"),
        ("link to /proc/self/fd/0", "/proc/self/fd/0"),
    ):
        yield Damage(what, place=_link(target))
    yield Damage("pipe", place=os.mkfifo)
    yield Damage("folder", place=Path.mkdir)
    yield Damage("1 TB of nothing", place=_sparse)
    yield Damage("missing", place=lambda path: None)
    for new in (
        f"line\nbreak.{suffix}",
        f"escape\x1b[31m.{suffix}",
        f"{'long' * 55}.{suffix}",
        f"not\udcff utf-8.{suffix}",
        f"line\u2028separator\u202e.{suffix}",
    ):
        yield Damage(f"damaged, its name {new[:20]!a}", data[:-9], name=new)
        yield Damage(f"missing, its name {new[:20]!a}", place=_nothing, name=new)


def _nothing(path: Path) -> None:
    pass


# What a JSON or YAML value may be instead of what it ought to be.
VALUES: dict[str, Any] = {
    "null": None,
    "true": True,
    "minus one": -1,
    "zero": 0,
    "one": 1,
    "half": 0.5,
    "1e300": 1e300,
    "NaN": float("nan"),
    "infinity": float("inf"),
    "a huge number": 10**30,
    "4,000 digits": 10**4000,
    "a text": "text",
    "no text": "",
    "a number as text": "1",
    "10,000 letters": "x" * 10_000,
    "line breaks": "a\nTraceback\r\x0b\x1b[31m\x85\u2028b",
    "a surrogate": "\ud800",
    "a path": "../canary",
    "empty list": [],
    "empty object": {},
    "list of a text": ["text"],
    "object": {"text": 1},
    "list in lists": [[[[[1]]]]],
}
DEEP = "[" * 100_000
