"""Folders of motion, of which one motion at a time is read.

A folder holds Motion files, or it is packed: its motions are then in a few archives,
the shards, and an index lists them. See :mod:`loco_drake.motion.packing`.
"""

import os
import zipfile
from abc import ABC, abstractmethod
from array import array
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import overload

from loco_drake.common.errors import InputError
from loco_drake.common.files import is_inside, parse_json
from loco_drake.motion.motion import Motion
from loco_drake.motion.motion_file import MAX_BYTES, load_motion, parse_motion

INDEX = "motions.jsonl"  # of a packed folder: a header, then a line for each motion
SHARDS = "motions-*.zip"
SCHEMA_VERSION = 1
_HASH_BYTES = 32


class Motions(Sequence[Motion], ABC):
    """The motions of a folder; each is read and checked when it is asked for.

    Memory holds their names. Asking raises InputError if a motion is damaged or was
    removed.
    """

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self.folder = folder
        self.names = names  # paths in the folder, with "/", in the order of the motions

    def __len__(self) -> int:
        return len(self.names)

    def path(self, index: int) -> str:
        """Returns where a motion is, as messages say it."""
        return os.path.join(self.folder, self.names[index])

    @overload
    def __getitem__(self, index: int) -> Motion: ...
    @overload
    def __getitem__(self, index: slice) -> list[Motion]: ...
    def __getitem__(self, index: int | slice) -> Motion | list[Motion]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        return self._read(index)

    @abstractmethod
    def content(self, index: int) -> bytes:
        """Returns the bytes of a motion's file."""

    @abstractmethod
    def _read(self, index: int) -> Motion: ...


class MotionFiles(Motions):
    """The Motion files ``*.npz`` of a folder, also of those inside it if ``nested``."""

    def __init__(self, folder: Path, *, nested: bool = True) -> None:
        # Hidden files are left by a process that was killed.
        search = folder.rglob if nested else folder.glob
        found = (path.relative_to(folder).as_posix() for path in search("[!.]*.npz"))
        super().__init__(folder, sorted(found, key=lambda name: name.split("/")))

    def content(self, index: int) -> bytes:
        """Returns the bytes of a motion's file."""
        return Path(self.path(index)).read_bytes()

    def _read(self, index: int) -> Motion:
        return load_motion(Path(self.path(index)))


class PackedMotions(Motions):
    """The motions of a packed folder.

    Raises:
        InputError: if its index is damaged or cut off.
    """

    def __init__(self, folder: Path) -> None:
        self._shards = array("i")  # number of the shard that a motion is in
        self._hashes = bytearray()  # SHA-256 of each motion's file
        super().__init__(folder, self._indexed(folder / INDEX))
        self._open: tuple[int, zipfile.ZipFile] | None = None  # the last one read from

    def content(self, index: int) -> bytes:
        """Returns the bytes of a motion's file, as it was packed."""
        index = range(len(self))[index]
        number, name = self._shards[index], self.names[index]
        try:
            content = self._archive(number).read(name)
        except Exception:  # zipfile raises many kinds
            self._open = None
            path = self.folder / shard_name(number)
            raise InputError(
                f"{path} is missing or damaged, at {name}; `data pack --resume` mends "
                "it."
            ) from None
        start = _HASH_BYTES * index
        if sha256(content).digest() != self._hashes[start : start + _HASH_BYTES]:
            raise InputError(
                f"{self.path(index)} is damaged: it is not the motion that {INDEX} "
                "lists; `data pack --resume` mends it."
            )
        return content

    def _read(self, index: int) -> Motion:
        return parse_motion(self.content(index), self.path(index))

    def _archive(self, number: int) -> zipfile.ZipFile:
        if self._open is None or self._open[0] != number:
            archive = zipfile.ZipFile(self.folder / shard_name(number))
            for info in archive.infolist():
                if info.compress_type != zipfile.ZIP_STORED or (
                    info.file_size > MAX_BYTES
                ):
                    raise ValueError("not a shard")
            self._open = number, archive
        return self._open[1]

    def _indexed(self, path: Path) -> list[str]:
        """Reads the index and returns the names."""
        names: list[str] = []
        try:
            with path.open(encoding="utf-8") as lines:
                header = parse_json(next(lines))
                if header["schema_version"] != SCHEMA_VERSION:
                    raise InputError(
                        f"{path} has schema {header['schema_version']}; this version "
                        f"reads {SCHEMA_VERSION}."
                    )
                for line in lines:
                    entry = parse_json(line)
                    found = bytes.fromhex(entry["sha256"])
                    if len(found) != _HASH_BYTES or not is_inside(entry["name"]):
                        raise ValueError("not an entry")
                    names.append(entry["name"])
                    self._shards.append(entry["shard"])
                    self._hashes += found
            whole = len(names) == header["motions"]
        except InputError:
            raise
        except Exception:  # of any content
            whole = False
        if not whole:
            raise InputError(
                f"{path} is damaged or cut off, after {len(names)} motions; `data pack "
                "--resume` writes it again."
            )
        return names


def shard_name(number: int) -> str:
    """Returns the file name of a shard of a packed folder."""
    return SHARDS.replace("*", f"{number:05}")


def open_motions(folder: Path, *, nested: bool = True) -> Motions:
    """Returns the motions of a folder, packed or not.

    Args:
        folder: holds Motion files, in the order of their names, or is packed.
        nested: whether Motion files of folders inside it count, too.

    Raises:
        InputError: if there is no such folder, or it is packed and not whole.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"There is no folder of Motion files {str(folder)!r}.")
    if (folder / INDEX).exists():
        return PackedMotions(folder)
    if any(folder.glob(SHARDS)):
        raise InputError(
            f"{str(folder)!r} is not packed to its end; `data pack --resume` goes on."
        )
    return MotionFiles(folder, nested=nested)
