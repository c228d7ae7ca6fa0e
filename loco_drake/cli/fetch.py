"""The command ``data fetch``."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

from loco_drake.cli.output import print_table, write_json
from loco_drake.common.errors import InputError, check_choice
from loco_drake.datasets.download import (
    Outcome,
    RemoteFile,
    download_files,
    files_by_source,
    parse_mirror,
)
from loco_drake.datasets.registry import DATASETS, data_target
from loco_drake.datasets.segments import add_shipped_rows, read_rows, write_rows

# Parts of the names of Creative Commons licences, and what they ask.
_CONDITIONS = {
    "BY": "name the authors",
    "NC": "no commercial use",
    "SA": "share what you make of it only under the same licence",
    "ND": "share no changed version",
}
_LISTED_FAILURES = 10


@dataclass(kw_only=True)
class DataFetch:
    """Downloads the recordings from where they are published, and checks each file.

    Files that are there already are not fetched again: run it once more after a failure
    or Ctrl-C. The stretches of segments.csv are written beside them; rows of your own
    stay. The recordings are under licences of their own, which are printed first.
    """

    source: tyro.conf.UseAppendAction[tuple[tuple[str, ...], ...]] = ()
    """Whose recordings, such as dog; several are allowed. Default: all."""
    data_dir: Path | None = None
    """Folder for the recordings. Default: $LOCO_DRAKE_DATA, else the user's cache."""
    mirror: str | None = None
    """Fetches from copies instead: a folder, or an http(s) address, laid out like the
    data folder."""
    json: Path | None = None
    """Writes the figures of each source to this file."""
    seed: int = 0
    """As in every command; nothing here is random."""

    def run(self) -> int:
        """Fetches what is missing; returns 1 if a file failed, else 0.

        Raises:
            InputError: if an option is wrong, or the folder's segments.csv damaged.
            OSError: if the folder cannot be written to.
        """
        files = self._files()
        mirror = parse_mirror(self.mirror)
        folder = data_target(self.data_dir)
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{str(folder)!r} is a file, not a folder for recordings.")
        table = folder / "segments.csv"
        rows = read_rows(table) if table.exists() else []
        missing = {
            source: [file for file in listed if not file.is_present(folder)]
            for source, listed in files.items()
        }
        _print_sources(files, missing)
        outcomes = self._download(_flat(missing), folder, mirror)
        failed = {outcome.file: outcome.error for outcome in outcomes if outcome.error}
        present = [file.name for file in _flat(files) if file not in failed]
        merged = add_shipped_rows(rows, present)
        if merged != rows:
            write_rows(table, merged)
        write_json(
            self.json,
            {
                source: {
                    "files": len(listed),
                    "bytes": sum(file.size for file in listed),
                    "fetched": len([f for f in missing[source] if f not in failed]),
                    "already_there": len(listed) - len(missing[source]),
                    "failed": {f.name: failed[f] for f in listed if f in failed},
                    "licence": DATASETS[source].licence,
                    "attribution": DATASETS[source].attribution,
                }
                for source, listed in files.items()
            },
        )
        fetched = len(outcomes) - len(failed)
        console = Console(highlight=False, soft_wrap=True)
        console.print(
            f"{len(present)} files in {folder}: {fetched} fetched, "
            f"{len(present) - fetched} already there",
            markup=False,
        )
        _print_failures([outcome for outcome in outcomes if outcome.error])
        return 1 if failed else 0

    def _files(self) -> dict[str, list[RemoteFile]]:
        files = files_by_source()
        wanted = [
            check_choice("source", s, files) for group in self.source for s in group
        ]
        return {s: listed for s, listed in files.items() if s in wanted or not wanted}

    def _download(
        self, files: Sequence[RemoteFile], folder: Path, mirror: str | Path | None
    ) -> list[Outcome]:
        progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            DownloadColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        with progress:
            task = progress.add_task("Fetching", total=sum(f.size for f in files))

            def report(done: int) -> None:
                progress.update(task, completed=done)

            return list(download_files(files, folder, mirror, report))


def _flat(files: dict[str, list[RemoteFile]]) -> list[RemoteFile]:
    return [file for listed in files.values() for file in listed]


def _print_sources(
    files: dict[str, list[RemoteFile]], missing: dict[str, list[RemoteFile]]
) -> None:
    print_table(
        "Recordings, and whose they are",
        ["source", "files", "MB", "MB to fetch", "licence", "attribution"],
        [
            [
                source,
                str(len(listed)),
                _megabytes(listed),
                _megabytes(missing[source]),
                DATASETS[source].licence,
                DATASETS[source].attribution,
            ]
            for source, listed in files.items()
        ],
    )
    console = Console(highlight=False, soft_wrap=True)
    for licence in dict.fromkeys(DATASETS[source].licence for source in files):
        if conditions := describe_licence(licence):
            console.print(f"{licence}: {conditions}.", markup=False)


def describe_licence(licence: str) -> str:
    """Returns what a Creative Commons licence asks; empty for any other."""
    if not licence.startswith("CC "):
        return ""
    parts = re.findall(r"[A-Z]+", licence)
    return ", ".join(text for part, text in _CONDITIONS.items() if part in parts)


def _print_failures(failed: Sequence[Outcome]) -> None:
    if not failed:
        return
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    for outcome in failed[:_LISTED_FAILURES]:
        console.print(f"Failed: {outcome.file.name} {outcome.error}", markup=False)
    more = len(failed) - _LISTED_FAILURES
    if more > 0:
        console.print(f"Failed: {more} more files")
    console.print("The same command again fetches only what is missing.")


def _megabytes(files: Iterable[RemoteFile]) -> str:
    return f"{sum(file.size for file in files) / 1e6:.1f}"
