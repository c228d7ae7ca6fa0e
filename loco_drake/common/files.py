"""Files that are either whole or not there, and what is read from them."""

import hashlib
import json
import math
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import platformdirs

from loco_drake.common.errors import InputError

# Figures that depend on the machine and what else it does, and the hash itself.
TIMES = ("real_time_factor", "frames_per_second", "wall_clock_s", "seconds", "sha256")
_MAX_JSON_BYTES = 64 * 2**20


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yields a temporary path that replaces ``path`` if the block succeeds.

    The temporary file lies in the same folder, so that the final rename is atomic;
    it keeps the suffix of ``path``, which some writers insist on. The folder is made
    if need be. On any exception the temporary file is removed and ``path`` is left
    as it was. A link is followed; a device or a pipe, such as /dev/stdout, is not
    replaced but written to.

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
            # What is the process's own output goes where that has got to.
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
    """Finds out, before work is done, whether its result can be written.

    Args:
        path: where to; None is nowhere.
        folder: whether files are to be written into it, not it itself.

    Raises:
        InputError: if a file is a folder.
        OSError: if what there is may not be written to, or a folder that is needed is
            a file.
    """
    if path is None:
        return
    path = Path(path)
    if folder:
        path /= "any"
    status = None if folder else _status(path)
    if status is not None and not os.access(path, os.W_OK):
        raise PermissionError(13, "No permission to write", str(path))
    if status is None or stat.S_ISREG(status.st_mode):
        parent = Path(os.path.realpath(path)).parent
        while not parent.exists():
            parent = parent.parent
        if not parent.is_dir():
            raise NotADirectoryError(20, "Not a folder", str(parent))
        if not os.access(parent, os.W_OK | os.X_OK):
            raise PermissionError(13, "No permission to write into", str(parent))


def _status(path: Path) -> os.stat_result | None:
    """Returns what there is at ``path``, links followed; None if nothing."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        return None
    except NotADirectoryError:
        return None  # said better where the folder is made
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{str(path)!r} is a folder, not a file to be written.")
    return status


def _standard_stream(status: os.stat_result | None) -> int | None:
    """Returns 1 or 2 if the file is where stdout or stderr goes."""
    for stream in (1, 2):
        try:
            if status is not None and os.path.samestat(status, os.fstat(stream)):
                return stream
        except OSError:  # closed
            continue
    return None


def parse_json(text: str | bytes) -> dict[str, Any]:
    """Returns the object that ``text`` holds.

    Raises:
        ValueError: if it is no JSON, or no object, or holds NaN, infinity, text that
            is not Unicode, or is nested too deeply.
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
    """Returns the JSON object in a file, such as the figures that a command wrote.

    Raises:
        InputError: if there is no such file, it cannot be read, is larger than 64 MB,
            or holds anything that :func:`parse_json` refuses.
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
        raise InputError(f"{path} is damaged: it is no JSON ({reason}).") from None


def content_sha256(header: Mapping[str, Any], parts: Mapping[str, bytes]) -> str:
    """Returns the hash of a file's content, however it is packed.

    Args:
        header: must be JSON; as it is written, and read back.
        parts: by a text that says name, type and shape.
    """
    digest = hashlib.sha256(json.dumps(header).encode())
    for name, data in sorted(parts.items()):
        digest.update(f"\n{name}\n".encode())
        digest.update(data)
    return digest.hexdigest()


def figures_sha256(figures: Any) -> str:
    """Returns the hash of what a command measured, but for TIMES.

    Two runs with one seed have the same.
    """

    def lasting(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {k: lasting(v) for k, v in value.items() if k not in TIMES}
        return list(map(lasting, value)) if isinstance(value, list | tuple) else value

    return content_sha256(lasting(figures), {})


def cache_dir() -> Path:
    """Returns the user's cache folder, or ``LOCO_DRAKE_CACHE`` where that is set."""
    override = os.environ.get("LOCO_DRAKE_CACHE")
    return (
        Path(override) if override else Path(platformdirs.user_cache_dir("loco_drake"))
    )
