"""Packing: many Motion files in a few archives, with an index.

A packed folder holds shards, uncompressed zip archives of up to 1000 Motion files, byte
for byte as they were, and an index with a line of JSON for each motion. Each file is
written under another name and then renamed, the index last, so that whoever is killed
loses at most a shard.
"""

import json
import zipfile
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import accumulate
from pathlib import Path
from typing import Any

from loco_drake.common.errors import InputError, quoted
from loco_drake.common.files import atomic_path, is_inside, parse_json
from loco_drake.motion.motion_folder import (
    INDEX,
    SCHEMA_VERSION,
    SHARDS,
    Motions,
    open_motions,
    shard_name,
)

SHARD_MOTIONS = 1000
# Of a shard, what the index says of its motions.
_PART = "index.jsonl"
Entry = dict[str, Any]


class _Sources:
    """The motions of several folders, one after the other."""

    def __init__(self, folders: Sequence[Path]) -> None:
        self._parts = [open_motions(folder) for folder in folders]
        self._prefixes = [folder.resolve().name for folder in folders]
        self._ends = list(accumulate(map(len, self._parts)))
        for prefix in self._prefixes:
            if self._prefixes.count(prefix) > 1:
                raise InputError(
                    f"Two folders are called {quoted(prefix)}; those that are packed "
                    "together need names of their own."
                )

    def __len__(self) -> int:
        return self._ends[-1]

    def at(self, row: int) -> tuple[Motions, int]:
        """Returns the folder that a motion is in, and its number there."""
        part = bisect_right(self._ends, row)
        return self._parts[part], row - self._ends[part] + len(self._parts[part])

    def name(self, row: int) -> str:
        """Returns a motion's name in the packed folder."""
        part = bisect_right(self._ends, row)
        motions, index = self.at(row)
        name = f"{self._prefixes[part]}/{motions.names[index]}"
        if not is_inside(name):
            raise InputError(
                f"A Motion file cannot be packed under the name {quoted(name)}: it "
                "needs one of at most 200 characters without control characters, "
                "colons and backslashes."
            )
        return name

    def content(self, row: int) -> bytes:
        """Returns the bytes of a motion's file."""
        motions, index = self.at(row)
        return motions.content(index)


@dataclass
class Packed:
    """What a packed folder holds."""

    motions: int = 0
    shards: int = 0
    frames: int = 0
    robots: set[str] = field(default_factory=set)
    of_label: Counter[str] = field(default_factory=Counter)  # motions
    seconds: Counter[str] = field(default_factory=Counter)  # by label

    def add(self, listed: Iterable[Entry]) -> None:
        """Adds a shard, of which the index says this."""
        self.shards += 1
        for entry in listed:
            self.motions += 1
            self.frames += entry["frames"]
            self.robots.add(entry["robot"])
            self.of_label[entry["label"]] += 1
            self.seconds[entry["label"]] += entry["frames"] / entry["fps"]


def pack(
    folders: Sequence[Path],
    out: Path,
    *,
    resume: bool = False,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> Packed:
    """Packs the motions of ``folders`` into ``out``.

    With ``resume``, shards stay that hold what the folders hold; others are written.
    ``report`` is told after each shard how many motions are done, and of how many.

    Raises:
        InputError: if there are no motions, one is unsound, two folders have one name,
            or ``out`` holds packed motion, of others if ``resume``, or none if so.
    """
    sources = _Sources(folders)
    if not len(sources):
        where = ", ".join(repr(str(folder)) for folder in folders)
        raise InputError(f"There are no Motion files (*.npz) in {where}.")
    starts = range(0, len(sources), SHARD_MOTIONS)
    _check(out, len(starts), resume)
    for left in out.glob(".motions*"):
        left.unlink()  # by a process that was killed
    packed = Packed()
    for number, start in enumerate(starts):
        rows = range(start, min(start + SHARD_MOTIONS, len(sources)))
        path = out / shard_name(number)
        packed.add(_kept(path, sources, rows) or _write(path, number, sources, rows))
        report(rows.stop, len(sources))
    header = {
        "schema_version": SCHEMA_VERSION,
        "motions": packed.motions,
        "shards": packed.shards,
    }
    with atomic_path(out / INDEX) as temporary, temporary.open("wb") as index:
        index.write(json.dumps(header).encode() + b"\n")
        for number in range(packed.shards):
            with zipfile.ZipFile(out / shard_name(number)) as archive:
                index.write(archive.read(_PART))
    return packed


def _check(out: Path, shards: int, resume: bool) -> None:
    """Raises InputError unless ``out`` may be written to."""
    found = sorted(path.name for path in out.glob(SHARDS))
    packed = bool(found) or (out / INDEX).exists()
    if packed and not resume:
        raise InputError(
            f"{str(out)!r} holds packed motion already; go on with --resume, or name "
            "another folder with --out."
        )
    if resume and not packed:
        raise InputError(
            f"There is nothing to resume in {str(out)!r}, which holds no packed "
            "motion; to begin, leave out --resume."
        )
    if found and found[-1] > shard_name(shards - 1):
        raise _other(out)


def _other(out: Path) -> InputError:
    return InputError(
        f"{str(out)!r} holds other motion than the folders to pack; name another "
        "folder with --out."
    )


def _kept(path: Path, sources: _Sources, rows: range) -> list[Entry] | None:
    """Returns what is in a shard if it is as the sources are, else None."""
    names = [sources.name(row) for row in rows]
    listed: list[Entry] = []
    with suppress(Exception), zipfile.ZipFile(path) as archive:  # zipfile raises many
        listed = [parse_json(line) for line in archive.read(_PART).splitlines()]
    if listed and [entry.get("name") for entry in listed] != names:
        raise _other(path.parent)
    try:
        with zipfile.ZipFile(path) as archive:
            same = (archive.read(sources.name(r)) == sources.content(r) for r in rows)
            return listed if listed and all(same) else None
    except (zipfile.BadZipFile, KeyError, FileNotFoundError):
        return None


def _write(path: Path, number: int, sources: _Sources, rows: range) -> list[Entry]:
    """Checks motions and writes them to a shard; returns what the index says."""
    listed: list[Entry] = []
    with (
        atomic_path(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive,
    ):
        for row in rows:
            motions, index = sources.at(row)
            motion, content = motions[index], motions.content(index)
            archive.writestr(_member(sources.name(row)), content)
            listed.append(
                {
                    "name": sources.name(row),
                    "shard": number,
                    "robot": motion.robot,
                    "label": str(motion.label),
                    "split": motion.provenance.get("split", ""),
                    "frames": len(motion),
                    "fps": motion.fps,
                    "sha256": sha256(content).hexdigest(),
                }
            )
        lines = "".join(f"{json.dumps(entry)}\n" for entry in listed)
        archive.writestr(_member(_PART), lines)
    return listed


def _member(name: str) -> zipfile.ZipInfo:
    """Returns a member's description without a time: the same motion, same file."""
    return zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
