"""Ways to damage a file of text, put together for each format."""

import json
import math
from collections.abc import Callable, Iterator

from tests.fuzzing import text
from tests.fuzzing.damage import Damage, Random

Damages = Callable[[bytes, Random], Iterator[Damage]]


def table(separator: str, header: int) -> Damages:
    def damages(data: bytes, random: Random) -> Iterator[Damage]:
        for _ in range(2):
            yield from text.tables(data.decode(), separator, header, random)
        yield from text.encodings(data.decode())

    return damages


def document(*parts: Callable[[str, Random], Iterator[Damage]]) -> Damages:
    def damages(data: bytes, random: Random) -> Iterator[Damage]:
        for part in parts:
            yield from part(data.decode(), random)
        yield from text.encodings(data.decode())

    return damages


def json_document(data: bytes, random: Random) -> Iterator[Damage]:
    yield from text.json_texts(json.loads(data), 250, random)
    yield from text.encodings(data.decode())


def last_line(data: bytes, random: Random) -> Iterator[Damage]:
    rows = data.decode().splitlines()
    for damage in text.json_texts(json.loads(rows[-1]), 80, random):
        body = b"\n".join([*(row.encode() for row in rows[:-1]), damage.data]) + b"\n"
        yield Damage(f"last line: {damage.what}", body)
    yield from text.encodings(data.decode())


def logs_alike(sound: bytes, other: bytes) -> bool:
    """Returns whether a log, which has no checksum, has only other figures."""

    def steps(data: bytes) -> list[int]:
        rows = [json.loads(line) for line in data.decode().splitlines()]
        figures = [value for row in rows for value in row.values()]
        if not all(type(v) in (int, float) and math.isfinite(v) for v in figures):
            raise ValueError
        return [row["steps"] for row in rows if "seconds" in row]

    try:
        return steps(sound) == steps(other)
    except (ValueError, LookupError, AttributeError, RecursionError, OverflowError):
        return False


def commands(data: bytes, random: Random) -> Iterator[Damage]:
    yield from text.tables(data.decode(), ",", 1, random)
    yield from text.csv_cells(data.decode(), random)
    yield from text.encodings(data.decode())


def bvh(data: bytes, random: Random) -> Iterator[Damage]:
    lines = data.decode().splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    yield from text.tables(data.decode(), " ", head, random)
    yield from text.encodings(data.decode())
    words = (
        "",
        "nan",
        "-1",
        "1e300",
        "0",
        "1e9",
        "x" * 10_000,
        "ROOT",
        "End",
        "{",
        "6",
    )
    words += ("}", "Xposition", "a\nb", "\x1b[31m", "3.7", "16.6667", "٣")
    places = [
        (k, n) for k, line in enumerate(lines[:head]) for n in range(len(line.split()))
    ]
    for k in random.permutation(len(places) * len(words))[:200]:
        (row, column), word = places[k // len(words)], words[k % len(words)]
        cells = lines[row].split()
        old, cells[column] = cells[column], word
        new = [*lines[:row], " ".join(cells), *lines[row + 1 :]]
        what = f"line {row + 1}: {old} is {word[:20]!a}"
        yield Damage(what, ("\n".join(new) + "\n").encode())
    for k in random.permutation(head)[:25]:
        gone, twice = lines[:k] + lines[k + 1 :], lines[: k + 1] + lines[k:]
        yield Damage(f"line {k + 1} missing", ("\n".join(gone) + "\n").encode())
        yield Damage(f"line {k + 1} twice", ("\n".join(twice) + "\n").encode())
    deep = "HIERARCHY\nROOT a\n" + "{\nJOINT a\n" * 20_000
    yield Damage("deep", deep.encode())
