"""The files of the recordings: where each is published, and its way into a folder."""

import csv
import hashlib
import io
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import requests

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path, is_inside, read_text
from loco_drake.datasets.registry import DATASETS

MANIFEST = Path(__file__).with_name("manifest.csv")
# What each column of a manifest holds, beside the names of the file here and there.
_COLUMNS = {
    "repository": r"[\w.-]+/[\w.-]+",
    "commit": "[0-9a-f]{40}",
    "bytes": r"[1-9]\d{0,9}",
    "sha256": "[0-9a-f]{64}",
}
# Without a connection every file would wait for its timeout: so many in a row suffice.
LOST_CONNECTIONS = 3
_CHUNK = 2**16
_TIMEOUT = 30.0  # s


@dataclass(frozen=True)
class RemoteFile:
    """One file of a recording as its authors, or others, published it."""

    name: str  # its path inside the data folder, with "/"; begins with the dataset's
    url: str  # address of the content, which no later commit can change
    size: int  # bytes
    sha256: str  # checksum of the content, in hexadecimal

    def is_present(self, folder: Path) -> bool:
        """Says whether the data folder has the file with the right content."""
        path = folder / self.name
        if not path.is_file() or path.stat().st_size != self.size:
            return False
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == self.sha256


def read_manifest(path: Path) -> list[RemoteFile]:
    """Returns the files listed in a manifest, in its order.

    Raises:
        InputError: naming the line that cannot be: damaged, a file outside the data
            folder, or one that another line names, too.
    """
    files: dict[str, RemoteFile] = {}
    reader = csv.reader(io.StringIO(read_text(path), newline=""))
    try:
        header = next(reader, [])
        for cells in reader:
            row = dict(zip(header, cells, strict=True))
            if row["file"] in files or not (
                is_inside(row["file"])
                and is_inside(row["path"])
                and all(re.fullmatch(_COLUMNS[name], row[name]) for name in _COLUMNS)
            ):
                raise ValueError
            files[row["file"]] = RemoteFile(
                name=row["file"],
                url="https://raw.githubusercontent.com/"
                f"{row['repository']}/{row['commit']}/{quote(row['path'])}",
                size=int(row["bytes"]),
                sha256=row["sha256"],
            )
    except (csv.Error, LookupError, ValueError):
        raise InputError(
            f"{path}: line {reader.line_num} is damaged, or names a file a second time "
            "or outside the data folder."
        ) from None
    return list(files.values())


def files_by_source() -> dict[str, list[RemoteFile]]:
    """Returns the shipped manifest's files of each source that can be read."""
    found: dict[str, list[RemoteFile]] = {source: [] for source in DATASETS}
    sources = {dataset.folder: source for source, dataset in DATASETS.items()}
    for file in read_manifest(MANIFEST):
        found.get(sources.get(file.name.split("/")[0], ""), []).append(file)
    return {source: files for source, files in found.items() if files}


def parse_mirror(text: str | None) -> str | Path | None:
    """Returns the address or the folder that holds copies of the data folder's files.

    None, the public origin, stays None.

    Raises:
        InputError: if it is neither an http(s) address nor a folder.
    """
    if text is None or text.startswith(("http://", "https://")):
        return text and text.rstrip("/")
    if not Path(text).is_dir():
        raise InputError(
            f"There is no mirror folder {text!r}: --mirror takes a folder, or an "
            "address that starts with http:// or https://."
        )
    return Path(text)


def download_files(
    files: Iterable[RemoteFile],
    folder: Path,
    mirror: str | Path | None = None,
    report: Callable[[int], object] = lambda done: None,
) -> Iterator[tuple[RemoteFile, str | None]]:
    """Fetches files, replacing those in the way, and yields what became of each.

    A file arrives whole and checked, or not at all, and one that fails does not stop
    the others. Only when ``LOST_CONNECTIONS`` files in a row find no connection are the
    rest not tried.

    Args:
        files: what to fetch.
        folder: the data folder; made if need be.
        mirror: what :func:`parse_mirror` returns; None for the public origin.
        report: is told the bytes done so far, a failed file's included.

    Yields:
        Each file, and why it could not be had as the end of a sentence, or None.

    Raises:
        OSError: if the data folder cannot be written to.
    """
    done = lost = 0
    for file in files:
        error: str | None = "was not tried, for want of a connection"
        if lost < LOST_CONNECTIONS:
            if isinstance(mirror, Path):
                chunks = _copy(mirror / file.name, file.size)
            else:
                chunks = _get(f"{mirror}/{quote(file.name)}" if mirror else file.url)
            try:
                for count in _write(chunks, file, folder):
                    report(done + count)
                lost, error = 0, None
            except _ConnectionLostError as failed:
                lost, error = lost + 1, str(failed)
            except _DownloadError as failed:
                lost, error = 0, str(failed)
        yield file, error
        done += file.size
        report(done)


class _DownloadError(Exception):
    """One file cannot be had; others may."""


class _ConnectionLostError(_DownloadError):
    """The server cannot be reached, so that other files will fare no better."""


def _write(chunks: Iterable[bytes], file: RemoteFile, folder: Path) -> Iterator[int]:
    """Writes a file of the data folder, and yields how many bytes have arrived."""
    path = folder / file.name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise _DownloadError("is led out of the data folder by a link")
    count, digest = 0, hashlib.sha256()
    with atomic_path(path) as temporary, temporary.open("wb") as target:
        for chunk in chunks:
            count += len(chunk)
            if count > file.size:
                raise _DownloadError("is longer than the manifest says")
            digest.update(chunk)
            target.write(chunk)
            yield count
        if digest.hexdigest() != file.sha256:
            raise _DownloadError("has another SHA-256 than the manifest says")


def _copy(path: Path, size: int) -> Iterator[bytes]:
    try:
        if path.stat().st_size != size:
            raise _DownloadError("has another size than the manifest says")
        content = path.read_bytes()
    except OSError as error:
        reason = f"cannot be read from the mirror: {error.strerror}"
        raise _DownloadError(reason) from None
    yield content


def _get(url: str) -> Iterator[bytes]:
    try:
        with requests.get(url, stream=True, timeout=_TIMEOUT) as response:
            response.raise_for_status()
            yield from response.iter_content(_CHUNK)
    except requests.HTTPError as error:
        status = str(error).split(" for url")[0]
        raise _DownloadError(f"was refused by the server: {status}") from None
    except requests.exceptions.ChunkedEncodingError:
        raise _DownloadError("was cut: the connection closed too early") from None
    except (requests.ConnectionError, requests.Timeout):
        raise _ConnectionLostError("found no connection to the server") from None
    except requests.RequestException as error:
        raise _DownloadError(f"cannot be fetched: {error}") from None
