"""Brings files of a manifest into the data folder: whole and checked, or not at all."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import pooch
import requests

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.datasets.manifest import RemoteFile

# Without a connection every file would wait for its timeout: so many in a row suffice.
LOST_CONNECTIONS = 3


@dataclass(frozen=True)
class Outcome:
    """What became of one file.

    Attributes:
        file: the file.
        error: why it could not be had, as the end of a sentence; None if it is there.
    """

    file: RemoteFile
    error: str | None = None


class DownloadError(Exception):
    """One file cannot be had; others may."""


class ConnectionLostError(DownloadError):
    """The server cannot be reached, so that other files will fare no better."""


def parse_mirror(text: str | None) -> str | Path | None:
    """Returns the address or the folder that holds copies of the data folder's files.

    None, the public origin, stays None.

    Raises:
        InputError: if it is neither an http(s) address nor a folder.
    """
    if text is None:
        return None
    if text.startswith(("http://", "https://")):
        return text.rstrip("/")
    folder = Path(text)
    if not folder.is_dir():
        raise InputError(
            f"There is no mirror folder {text!r}: --mirror takes a folder, or an "
            "address that starts with http:// or https://."
        )
    return folder


def is_present(file: RemoteFile, folder: Path) -> bool:
    """Says whether the data folder has the file with the right content."""
    path = folder / file.name
    return (
        path.is_file()
        and path.stat().st_size == file.size
        and pooch.file_hash(str(path)) == file.sha256
    )


def download_files(
    files: Iterable[RemoteFile],
    folder: Path,
    mirror: str | Path | None = None,
    report: Callable[[int], object] = lambda done: None,
) -> Iterator[Outcome]:
    """Fetches files, replacing those in the way, and yields what became of each.

    A file that fails leaves what was there before, and does not stop the others. Only
    when ``LOST_CONNECTIONS`` files in a row find no connection are the rest not tried.

    Args:
        files: what to fetch.
        folder: the data folder; made if need be.
        mirror: what :func:`parse_mirror` returns; None for the public origin.
        report: is told the bytes done so far, a failed file's included.

    Raises:
        OSError: if the data folder cannot be written to.
    """
    done = 0
    lost = 0
    for file in files:
        if lost == LOST_CONNECTIONS:
            yield Outcome(file, "was not tried, for want of a connection")
            continue
        try:
            _download(file, folder / file.name, mirror, _Meter(file.size, done, report))
            lost = 0
            yield Outcome(file)
        except DownloadError as error:
            lost = lost + 1 if isinstance(error, ConnectionLostError) else 0
            yield Outcome(file, str(error))
        done += file.size
        report(done)


def _download(
    file: RemoteFile, target: Path, mirror: str | Path | None, meter: "_Meter"
) -> None:
    with atomic_path(target) as temporary:
        if isinstance(mirror, Path):
            temporary.write_bytes(_read(mirror / file.name))
        else:
            url = file.url if mirror is None else f"{mirror}/{quote(file.name)}"
            _get(url, temporary, meter)
        if pooch.file_hash(str(temporary)) != file.sha256:
            raise DownloadError("has another SHA-256 than the manifest says")


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DownloadError(
            f"cannot be read from the mirror: {error.strerror}"
        ) from None


def _get(url: str, target: Path, meter: "_Meter") -> None:
    download = pooch.HTTPDownloader(progressbar=meter, chunk_size=2**16)
    try:
        download(url, str(target), None)
    except requests.HTTPError as error:
        if error.response is not None:
            error.response.close()  # nobody reads its body
        status = str(error).split(" for url")[0]
        raise DownloadError(f"was refused by the server: {status}") from None
    except requests.exceptions.ChunkedEncodingError:
        raise DownloadError("was cut: the connection closed too early") from None
    except (requests.ConnectionError, requests.Timeout):
        raise ConnectionLostError("found no connection to the server") from None
    except requests.RequestException as error:
        raise DownloadError(f"cannot be fetched: {error}") from None


class _Meter:
    """What pooch takes for a progress bar: reports bytes over all files."""

    def __init__(self, size: int, before: int, report: Callable[[int], object]) -> None:
        self.total = size
        self._size = size
        self._before = before
        self._report = report
        self._done = 0

    def update(self, count: int) -> None:
        # Pooch counts whole chunks, also for the last one, which is shorter.
        self._done = min(self._done + count, self._size)
        self._report(self._before + self._done)

    def reset(self) -> None:
        self._done = 0

    def close(self) -> None:
        pass
