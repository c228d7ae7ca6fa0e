"""The command ``data fetch``."""

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console
from rich.progress import DownloadColumn, Progress

from loco_drake.cli.options import SOURCES, DataDir, Json, UnusedSeed, option
from loco_drake.cli.output import do_all, print_table, say, write_json
from loco_drake.common.errors import InputError, check_choice

if TYPE_CHECKING:
    from loco_drake.datasets.download import RemoteFile

# Parts of the names of Creative Commons licences, and what they ask.
_CONDITIONS = {
    "BY": "name the authors",
    "NC": "no commercial use",
    "SA": "share what you make of it only under the same licence",
    "ND": "share no changed version",
}
_LISTED_FAILURES = 10
_PACKAGE_MB = 103  # of which 1.3 are kept


@dataclass(kw_only=True)
class DataFetch:
    """Download the recordings from their publishers and check each file.

    Prints the licences of the recordings first. Files that are complete are not
    downloaded again, so the command can be repeated after a failure or Ctrl-C. Adds the
    shipped rows to segments.csv and keeps your own.
    """

    source: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        option(
            f"{SOURCES}, and human, which is in a package that pip downloads; several "
            "may be named.",
            metavar="SOURCE ...",
            default="all but human",
        ),
    ] = ()
    data_dir: DataDir = None
    # Download from a copy: a folder or an http(s) address with the layout of the data
    # folder.
    mirror: Annotated[
        str | None,
        option(name="from", metavar="DIR|URL", default="from the publishers"),
    ] = None
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Fetches what is missing; returns 1 if a file failed, else 0."""
        from loco_drake.datasets import download, human, human_download, segments
        from loco_drake.datasets.registry import data_target

        files = download.files_by_source()
        known = [*files, human.SOURCE]
        if wanted := [check_choice("source", s, known) for g in self.source for s in g]:
            files = {source: files[source] for source in files if source in wanted}
        if human.SOURCE in wanted:
            files[human.SOURCE] = human_download.human_files()
        mirror = download.parse_mirror(self.mirror)
        folder = data_target(self.data_dir)
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{str(folder)!r} is a file, not a folder for recordings.")
        table = folder / "segments.csv"
        if table.is_symlink():
            raise InputError(f"{str(table)!r} is a link, which is not written to.")
        rows = segments.read_rows(table) if table.exists() else []
        missing = {
            source: [file for file in listed if not file.is_present(folder)]
            for source, listed in files.items()
        }
        _print_sources(files, missing)
        to_fetch = [file for listed in missing.values() for file in listed]
        columns = (*Progress.get_default_columns(), DownloadColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task("Fetching", total=sum(f.size for f in to_fetch))

            def report(done: int) -> None:
                bar.update(task, completed=done)

            with TemporaryDirectory() as unpacked:
                clips = missing.get(human.SOURCE, [])
                if clips and mirror is None:
                    say(f"pip downloads {human_download.PACKAGE}, {_PACKAGE_MB} MB.")
                    human_download.unpack_package(clips, Path(unpacked))
                others = [file for file in to_fetch if file not in clips]
                outcomes = [
                    *download.download_files(others, folder, mirror, report),
                    *download.download_files(clips, folder, mirror or Path(unpacked)),
                ]
            failed = {file.name: error for file, error in outcomes if error}
        names = [file.name for listed in files.values() for file in listed]
        present = [name for name in names if name not in failed]
        merged = segments.add_shipped_rows(rows, present)
        if merged != rows:
            segments.write_rows(table, merged)
        figures = {}
        for source, listed in files.items():
            lost = {f.name: failed[f.name] for f in listed if f.name in failed}
            figures[source] = {
                "files": len(listed),
                "bytes": sum(file.size for file in listed),
                "fetched": len(missing[source]) - len(lost),
                "already_there": len(listed) - len(missing[source]),
                "failed": lost,
                **dict(zip(("licence", "attribution"), _whose(source), strict=True)),
            }
        here, fetched = len(names) - len(to_fetch), len(to_fetch) - len(failed)
        told = f"{fetched} fetched, {here} already there"
        lines = [f"Failed: {name} {error}" for name, error in failed.items()]
        if (more := len(lines) - _LISTED_FAILURES) > 0:
            lines[_LISTED_FAILURES:] = [f"Failed: {more} more files"]
        if failed:
            lines.append("The same command again fetches only what is missing.")
        do_all(
            lambda: print(f"{len(present)} files in {folder}: {told}"),
            lambda: print("\n".join(lines), end="\n" * bool(lines), file=sys.stderr),
            lambda: write_json(self.json, figures),
        )
        return 1 if failed else 0


def _print_sources(
    files: "dict[str, list[RemoteFile]]", missing: "dict[str, list[RemoteFile]]"
) -> None:
    rows = []
    for source, listed in files.items():
        sizes = [sum(file.size for file in of) for of in (listed, missing[source])]
        megabytes = [f"{size / 1e6:.1f}" for size in sizes]
        rows.append((source, str(len(listed)), *megabytes, *_whose(source)))
    columns = ("source", "files", "MB", "MB to fetch", "licence", "attribution")
    print_table("Recordings, and whose they are", columns, rows)
    for licence in dict.fromkeys(_whose(source)[0] for source in files):
        if conditions := describe_licence(licence):
            print(f"{licence}: {conditions}.")


def _whose(source: str) -> tuple[str, str]:
    """Returns a source's licence and authors."""
    from loco_drake.datasets import human
    from loco_drake.datasets.registry import DATASETS

    if source == human.SOURCE:
        return human.LICENCE, human.ATTRIBUTION
    return DATASETS[source].licence, DATASETS[source].attribution


def describe_licence(licence: str) -> str:
    """Returns what a Creative Commons licence asks; empty for any other."""
    if not licence.startswith("CC "):
        return ""
    parts = re.findall(r"[A-Z]+", licence)
    return ", ".join(text for part, text in _CONDITIONS.items() if part in parts)
