"""Files that are either whole or not there."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import platformdirs


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yields a temporary path that replaces ``path`` if the block succeeds.

    The temporary file lies in the same folder, so that the final rename is atomic;
    it keeps the suffix of ``path``, which some writers insist on. The folder is made
    if need be. On any exception the temporary file is removed and ``path`` is left
    as it was.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(
        dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix
    )
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp is private to the user; an ordinary file follows the umask.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def cache_dir() -> Path:
    """Returns the user's cache folder, or ``LOCO_DRAKE_CACHE`` where that is set."""
    override = os.environ.get("LOCO_DRAKE_CACHE")
    return (
        Path(override) if override else Path(platformdirs.user_cache_dir("loco_drake"))
    )
