"""The files of the recordings: where each is published, and its way into a folder."""

import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.parse import quote

import pooch
import requests

from loco_drake.common.errors import InputError
from loco_drake.common.files import is_inside, read_text
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

pooch.get_logger().setLevel("ERROR")


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
        return (
            path.is_file()
            and path.stat().st_size == self.size
            and pooch.file_hash(str(path)) == self.sha256
        )


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
            f"There is no mirror folder {text!r}: --from takes a folder, or an "
            "address that starts with http:// or https://."
        )
    return Path(text)


def download_files(
    files: Sequence[RemoteFile],
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
    urls = {
        file.name: file.url
        if mirror is None
        else f"{mirror}/{quote(file.name) if isinstance(mirror, str) else file.name}"
        for file in files
    }
    hashes = {file.name: file.sha256 for file in files}
    keeper = pooch.create(path=folder, base_url="", registry=hashes, urls=urls)
    fetch = _copy if isinstance(mirror, Path) else _get
    done = lost = 0
    for file in files:
        error: str | None = "was not tried, for want of a connection"
        if lost < LOST_CONNECTIONS:
            meter = _Meter(file.size, done, report)
            try:
                if not (folder / file.name).resolve().is_relative_to(folder.resolve()):
                    raise _DownloadError("is led out of the data folder by a link")
                keeper.fetch(file.name, downloader=partial(fetch, meter=meter))
                lost, error = 0, None
            except _ConnectionLostError as failed:
                lost, error = lost + 1, str(failed)
            except _DownloadError as failed:
                lost, error = 0, str(failed)
            except ValueError:  # of pooch
                lost, error = 0, "has another SHA-256 than the manifest says"
        yield file, error
        done += file.size
        report(done)


class _DownloadError(Exception):
    """One file cannot be had; others may."""


class _ConnectionLostError(_DownloadError):
    """The server cannot be reached, so that other files will fare no better."""


def _copy(source: str, target: str, _: object, *, meter: "_Meter") -> None:
    try:
        if Path(source).stat().st_size != meter.size:
            raise _DownloadError("has another size than the manifest says")
        content = Path(source).read_bytes()
    except OSError as error:
        reason = f"cannot be read from the mirror: {error.strerror}"
        raise _DownloadError(reason) from None
    _renew(target).write_bytes(content)


def _get(url: str, target: str, _: object, *, meter: "_Meter") -> None:
    download = pooch.HTTPDownloader(progressbar=meter, chunk_size=_CHUNK)
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
        self._before, self._done, self._report = before, 0, report

    def update(self, count: int) -> None:
        self._done += count
        # Pooch counts whole chunks, also for the last one, which is shorter.
        if self._done > self.size + _CHUNK:
            raise _DownloadError("is longer than the manifest says")
        self._report(self._before + min(self._done, self.size))

    def reset(self) -> None:
        self._done = 0

    def close(self) -> None:
        pass
