"""Output of commands: tables for people, JSON for programs."""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table
from rich.text import Text

from loco_drake.common import files
from loco_drake.common.errors import InputError, one_line
from loco_drake.common.files import atomic_path, check_writable, figures_sha256

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Item = TypeVar("Item")


def check_output(path: Path | None, *, folder: bool = False) -> None:
    """Checks before any work whether an output, if any, can be written.

    Args:
        path: of the file, or of the folder for files.
        folder: whether it is a folder.

    Raises:
        InputError: if it cannot.
    """
    try:
        check_writable(path, folder=folder)
    except OSError as error:
        reason = f"{error.strerror}: {error.filename}"
        raise InputError(f"{str(path)!r} cannot be written: {reason}.") from None


def do_all(*steps: Callable[[], object]) -> None:
    """Does all steps at the end of work, such as to print and to save figures.

    A full disk or a closed pipe at one of them keeps none of the others.

    Raises:
        OSError: the first of the steps, after all of them.
    """
    errors = []
    for step in steps:
        try:
            step()
            # Before JSON that goes to /dev/stdout, which has no buffer.
            sys.stdout.flush()
        except OSError as error:
            errors.append(error)
    if errors:
        raise errors[0]


def write_json(path: Path | None, figures: dict[str, Any]) -> None:
    """Writes a command's figures to ``path``; None writes nothing."""
    if path is not None:
        files.write_json(path, figures)


def write_figure(figure: "Figure", path: Path, dpi: int = 120) -> None:
    """Writes a plot, atomically."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi)


def write_results(path: Path | None, figures: dict[str, Any]) -> None:
    """Writes results for ``report``, with a hash that detects damage."""
    write_json(path, {**figures, "sha256": figures_sha256(figures)})


def print_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]
) -> None:
    """Prints a table to stdout; the first column is text, the others are numbers.

    Names of files and gaits may hold anything: they are no markup, and one line.
    """
    table = Table(
        title=Text(one_line(title)),
        title_justify="left",
        box=SIMPLE_HEAD,
        pad_edge=False,
    )
    for index, column in enumerate(columns):
        first = index == 0
        table.add_column(
            column, justify="left" if first else "right", no_wrap=first, overflow="fold"
        )
    for row in rows:
        table.add_row(*(Text(one_line(cell)) for cell in row))
    # Rich takes a file or a pipe for a terminal of 80 columns.
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def print_lines(lines: Iterable[str]) -> None:
    """Prints lines to stdout as they are; names in them may hold anything."""
    for line in lines:
        print(one_line(line))


def tracked(items: Iterable[Item], what: str, total: int) -> Iterable[Item]:
    """Yields items and shows in a terminal how many of ``total`` there have been."""
    console = Console(stderr=True)
    hidden = not console.is_terminal
    return track(items, what, total, console=console, transient=True, disable=hidden)


def say(text: str) -> None:
    """Prints one line on stderr."""
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    console.print(one_line(text), markup=False)


def print_failed(failed: Iterable[tuple[str, str]]) -> None:
    """Prints failed clips and the reasons on stderr."""
    for name, reason in failed:
        say(f"Failed: {name}: {reason}")


# Behind the name of a row whose figures are outside their bounds.
MARK = " (!)"


def print_warnings(warnings: Mapping[str, Sequence[str]]) -> None:
    """Prints how many clips are outside their bounds, and on stderr how, by clip."""
    if warnings:
        print(f"(!) Outside their bounds, see the warnings: {len(warnings)}")
    for name, sentences in warnings.items():
        say(f"Warning: {name}: {'; '.join(sentences)}")
