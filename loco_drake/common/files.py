"""Atomic writes, checked JSON and content hashes."""

import hashlib
import json
import math
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import platformdirs

from loco_drake.common.errors import InputError

# Figures that depend on the machine or its load, and the hash itself.
TIMES = ("real_time_factor", "frames_per_second", "wall_clock_s", "seconds", "sha256")
_MAX_JSON_BYTES = 64 * 2**20
# Of recordings, those known here have up to 3 MB, 90 s; this is enough for 25 minutes.
_MAX_TEXT_BYTES = 50_000_000

# The marks that spreadsheets put before a text, and what they say of it.
_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yields a temporary path that replaces ``path`` if the block succeeds.

    The temporary file is in the same folder, so the final rename is atomic, and has the
    suffix of ``path``, which some writers require. The folder is created if necessary.
    On an exception the temporary file is removed and ``path`` is unchanged. Links are
    followed. Devices and pipes, such as /dev/stdout, are written to rather than
    replaced.

    Raises:
        InputError: if ``path`` is a folder.
    """
    status = _status(path)
    standard = _standard_stream(status)
    special = status is not None and not stat.S_ISREG(status.st_mode)
    direct = special or standard is not None
    target = Path(path) if direct else Path(os.path.realpath(path))
    folder = Path(tempfile.gettempdir()) if direct else target.parent
    folder.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(
        dir=folder, prefix=f".{target.stem[:50]}.", suffix=target.suffix
    )
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        if direct:
            # The process's own output continues at its current position.
            end = target if standard is None else os.dup(standard)
            with temporary.open("rb") as source, open(end, "wb") as sink:
                shutil.copyfileobj(source, sink)
        else:
            # mkstemp is private to the user; an ordinary file follows the umask.
            umask = os.umask(0)
            os.umask(umask)
            temporary.chmod(0o666 & ~umask)
            temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(path: Path | None, *, folder: bool = False) -> None:
    """Checks before any work whether its result, if any, can be written.

    Args:
        path: of the result, or of the folder for its files.
        folder: whether it is a folder.

    Raises:
        InputError: if it is a folder and should not be.
        OSError: if an existing path is not writable, a parent folder is a file, or the
            disk is full.
    """
    if path is None:
        return
    path = Path(path) / "any" if folder else Path(path)
    status = None if folder else _status(path)
    if status is not None and not os.access(path, os.W_OK):
        raise PermissionError(13, "No permission to write", str(path))
    if status is None or stat.S_ISREG(status.st_mode):
        parents = Path(os.path.realpath(path)).parents
        parent = next(folder for folder in parents if folder.exists())
        if not parent.is_dir():
            raise NotADirectoryError(20, "Not a folder", str(parent))
        if not os.access(parent, os.W_OK | os.X_OK):
            raise PermissionError(13, "No permission to write into", str(parent))
        if shutil.disk_usage(parent).free == 0:
            raise OSError(28, "No space left on the disk", str(parent))


def _status(path: Path) -> os.stat_result | None:
    """Returns the status of ``path``, links followed; None if it does not exist."""
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return None
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{str(path)!r} is a folder, not a file to be written.")
    return status


def _standard_stream(status: os.stat_result | None) -> int | None:
    """Returns 1 or 2 if the file is stdout or stderr, else None."""
    for stream in (1, 2):
        try:
            if status is not None and os.path.samestat(status, os.fstat(stream)):
                return stream
        except OSError:  # closed
            continue
    return None


def parse_json(text: str | bytes) -> dict[str, Any]:
    """Returns the JSON object in ``text``.

    Raises:
        ValueError: if it is not a JSON object, contains NaN, infinity or invalid
            Unicode, or is nested too deeply.
    """

    def finite(number: str) -> float:
        value = float(number)
        if not math.isfinite(value):
            raise ValueError(f"{number[:20]} is not finite")
        return value

    try:
        content = json.loads(text, parse_float=finite, parse_constant=finite)
        json.dumps(content, ensure_ascii=False).encode()
    except RecursionError:
        raise ValueError("nested too deeply") from None
    if not isinstance(content, dict):
        raise ValueError("not an object")
    return content


def read_json(path: Path) -> dict[str, Any]:
    """Returns the JSON object in a file, such as the figures of a command.

    Raises:
        InputError: if the file does not exist, cannot be read, is larger than 64 MB, or
            is refused by :func:`parse_json`.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"There is no file {str(path)!r}.")
    try:
        if path.stat().st_size > _MAX_JSON_BYTES:
            raise ValueError(f"larger than {_MAX_JSON_BYTES >> 20} MB")
        return parse_json(path.read_bytes().decode("utf-8-sig"))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path} is damaged: it is not JSON ({reason}).") from None


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON object, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2) + "\n")


def read_text(path: Path) -> str:
    r"""Returns a text file, UTF-8 or with the mark of UTF-16, lines ending in ``\n``.

    Raises:
        InputError: if the file cannot be read, is binary or larger than 50 MB.
    """
    try:
        if not path.is_file():
            raise InputError(f"There is no file {str(path)!r}.")
        with path.open("rb") as file:
            content = file.read(_MAX_TEXT_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    if len(content) > _MAX_TEXT_BYTES:
        megabytes = _MAX_TEXT_BYTES // 10**6
        raise InputError(f"{path} is larger than {megabytes} MB.")
    encoding = next((_MARKS[m] for m in _MARKS if content.startswith(m)), "utf-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path} is not plain text.")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_number(text: str) -> float:
    """Returns a number as tables write it; Python's ``1_0`` and other digits are none.

    Raises:
        ValueError: if it is no number.
    """
    if "_" in text or not text.isascii():
        raise ValueError("no number")
    return float(text)


def is_inside(name: str) -> bool:
    """Says whether a relative path, written with ``/``, stays inside its folder.

    Names that another system would take for a drive or a folder are not inside.
    """
    return (
        len(name) <= 200
        and not re.search(r"[\x00-\x1f\x7f\\:]", name)
        and all(part.strip(". ") for part in name.split("/"))
    )


def content_sha256(header: Mapping[str, Any], parts: Mapping[str, bytes]) -> str:
    """Returns the hash of a file's content, independent of its compression.

    Args:
        header: JSON, as it is written and read back.
        parts: content by a key that states name, type and shape.
    """
    digest = hashlib.sha256(json.dumps(header).encode())
    for name, data in sorted(parts.items()):
        digest.update(f"\n{name}\n".encode())
        digest.update(data)
    return digest.hexdigest()


def figures_sha256(figures: Any) -> str:
    """Returns the hash of the figures of a command, excluding TIMES.

    Two runs with the same seed have the same hash.
    """

    def lasting(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {k: lasting(v) for k, v in value.items() if k not in TIMES}
        return list(map(lasting, value)) if isinstance(value, list | tuple) else value

    return content_sha256(lasting(figures), {})


def cache_dir() -> Path:
    """Returns the cache folder: ``LOCO_DRAKE_CACHE`` if set, else the user's."""
    override = os.environ.get("LOCO_DRAKE_CACHE")
    return Path(override or platformdirs.user_cache_dir("loco_drake"))
