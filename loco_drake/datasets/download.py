"""The files of the recordings: where each is published, and its way into a folder."""

import csv
import io
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.parse import quote

import pooch
import requests

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import DATASETS
from loco_drake.datasets.text import is_inside, read_text

MANIFEST = Path(__file__).with_name("manifest.csv")

# What each column of a manifest holds.
_COLUMNS = {
    "repository": r"[\w.-]+/[\w.-]+",
    "commit": "[0-9a-f]{40}",
    "bytes": r"[1-9]\d{0,9}",
    "sha256": "[0-9a-f]{64}",
}
# Without a connection every file would wait for its timeout: so many in a row suffice.
LOST_CONNECTIONS = 3
CHUNK = 2**16

pooch.get_logger().setLevel("ERROR")


@dataclass(frozen=True)
class RemoteFile:
    """One file of a recording as its authors, or others, published it.

    Attributes:
        name: its path inside the data folder, with ``/``.
        repository: ``owner/name`` on GitHub.
        commit: the commit in which it has the content that ``sha256`` describes.
        path: its path inside the repository.
        size: bytes.
        sha256: checksum of the content, in hexadecimal.
    """

    name: str
    repository: str
    commit: str
    path: str
    size: int
    sha256: str

    @property
    def folder(self) -> str:
        """The dataset's folder, the first part of the name."""
        return self.name.split("/")[0]

    @property
    def url(self) -> str:
        """Address of the content, which no later commit can change."""
        return (
            f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/"
            f"{quote(self.path)}"
        )

    def is_present(self, folder: Path) -> bool:
        """Says whether the data folder has the file with the right content."""
        path = folder / self.name
        return (
            path.is_file()
            and path.stat().st_size == self.size
            and pooch.file_hash(str(path)) == self.sha256
        )


@dataclass(frozen=True)
class Outcome:
    """What became of one file.

    Attributes:
        file: the file.
        error: why it could not be had, as the end of a sentence; None if it is there.
    """

    file: RemoteFile
    error: str | None = None


def read_manifest(path: Path) -> list[RemoteFile]:
    """Returns the files listed in a manifest, in its order.

    Raises:
        InputError: naming the line that cannot be: damaged, a file outside the data
            folder, or one that another line names, too.
    """
    files: dict[str, RemoteFile] = {}
    reader = csv.DictReader(io.StringIO(read_text(path, "a manifest"), newline=""))
    try:
        for row in reader:
            cells = {k: v or "" for k, v in row.items() if k is not None}
            right = all(is_inside(cells.get(name, "")) for name in ("file", "path"))
            for name, pattern in _COLUMNS.items():
                right &= (
                    re.fullmatch(pattern, cells.get(name, ""), re.ASCII) is not None
                )
            if not right or None in row or cells["file"] in files:
                raise csv.Error
            files[cells["file"]] = RemoteFile(
                name=cells["file"],
                repository=cells["repository"],
                commit=cells["commit"],
                path=cells["path"],
                size=int(cells["bytes"]),
                sha256=cells["sha256"],
            )
    except csv.Error:
        raise InputError(
            f"{path}: line {reader.line_num} is no entry of a manifest, or is not for "
            "it alone."
        ) from None
    return list(files.values())


def files_by_source() -> dict[str, list[RemoteFile]]:
    """Returns the shipped manifest's files of each source that can be read."""
    files = read_manifest(MANIFEST)
    found = {
        source: [file for file in files if file.folder == dataset.folder]
        for source, dataset in DATASETS.items()
    }
    return {source: listed for source, listed in found.items() if listed}


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


def download_files(
    files: Iterable[RemoteFile],
    folder: Path,
    mirror: str | Path | None = None,
    report: Callable[[int], object] = lambda done: None,
) -> Iterator[Outcome]:
    """Fetches files, replacing those in the way, and yields what became of each.

    A file arrives whole and checked, or not at all, and one that fails does not stop
    the others. Only when ``LOST_CONNECTIONS`` files in a row find no connection are the
    rest not tried.

    Args:
        files: what to fetch.
        folder: the data folder; made if need be.
        mirror: what :func:`parse_mirror` returns; None for the public origin.
        report: is told the bytes done so far, a failed file's included.

    Raises:
        OSError: if the data folder cannot be written to.
    """
    files = list(files)
    urls = {
        file.name: file.url
        if mirror is None
        else f"{mirror}/{quote(file.name) if isinstance(mirror, str) else file.name}"
        for file in files
    }
    keeper = pooch.create(
        path=folder,
        base_url="",
        registry={file.name: file.sha256 for file in files},
        urls=urls,
    )
    fetch = _copy if isinstance(mirror, Path) else _get
    done = lost = 0
    for file in files:
        error: str | None = "was not tried, for want of a connection"
        if lost < LOST_CONNECTIONS:
            meter = _Meter(file.size, done, report)
            try:
                _check_target(file, folder)
                keeper.fetch(file.name, downloader=partial(fetch, meter=meter))
                lost, error = 0, None
            except _ConnectionLostError as failed:
                lost, error = lost + 1, str(failed)
            except _DownloadError as failed:
                lost, error = 0, str(failed)
            except ValueError:
                lost, error = 0, "has another SHA-256 than the manifest says"
        yield Outcome(file, error)
        done += file.size
        report(done)


class _DownloadError(Exception):
    """One file cannot be had; others may."""


class _ConnectionLostError(_DownloadError):
    """The server cannot be reached, so that other files will fare no better."""


def _check_target(file: RemoteFile, folder: Path) -> None:
    """Raises _DownloadError if a link leads the file out of the data folder."""
    if not (folder / file.name).resolve().is_relative_to(folder.resolve()):
        raise _DownloadError("would lie outside the data folder, where a link leads")


def _copy(source: str, target: str, _: object, *, meter: "_Meter") -> None:
    try:
        if Path(source).stat().st_size != meter.size:
            raise _DownloadError("has another size than the manifest says")
        with open(source, "rb") as original:
            content = original.read()
    except OSError as error:
        raise _DownloadError(
            f"cannot be read from the mirror: {error.strerror}"
        ) from None
    _renew(target).write_bytes(content)


def _get(url: str, target: str, _: object, *, meter: "_Meter") -> None:
    download = pooch.HTTPDownloader(progressbar=meter, chunk_size=CHUNK)
    try:
        download(url, str(_renew(target)), None)
    except requests.HTTPError as error:
        if error.response is not None:
            error.response.close()  # nobody reads its body
        status = str(error).split(" for url")[0]
        raise _DownloadError(f"was refused by the server: {status}") from None
    except requests.exceptions.ChunkedEncodingError:
        raise _DownloadError("was cut: the connection closed too early") from None
    except (requests.ConnectionError, requests.Timeout):
        raise _ConnectionLostError("found no connection to the server") from None
    except requests.RequestException as error:
        raise _DownloadError(f"cannot be fetched: {error}") from None


def _renew(temporary: str) -> Path:
    """Removes pooch's temporary file: it is private, a new one follows the umask."""
    Path(temporary).unlink()
    return Path(temporary)


class _Meter:
    """What pooch takes for a progress bar: reports bytes over all files."""

    def __init__(self, size: int, before: int, report: Callable[[int], object]) -> None:
        self.size = self.total = size
        self._before = before
        self._report = report
        self._done = 0

    def update(self, count: int) -> None:
        self._done += count
        # Pooch counts whole chunks, also for the last one, which is shorter.
        if self._done > self.size + CHUNK:
            raise _DownloadError("is longer than the manifest says")
        self._report(self._before + min(self._done, self.size))

    def reset(self) -> None:
        self._done = 0

    def close(self) -> None:
        pass
