"""What commands print for people and write for programs."""

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from loco_drake.files import atomic_path


def write_json(path: Path | None, figures: dict[str, Any]) -> None:
    """Writes a command's figures to ``path``; None writes nothing."""
    if path is not None:
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(figures, indent=2) + "\n")


def print_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]
) -> None:
    """Prints a table to stdout; the first column is text, the others are numbers."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for index, column in enumerate(columns):
        first = index == 0
        table.add_column(
            column, justify="left" if first else "right", no_wrap=first, overflow="fold"
        )
    for row in rows:
        table.add_row(*row)
    # Rich takes a file or a pipe for a terminal of 80 columns.
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def print_failed(failed: Iterable[tuple[str, str]]) -> None:
    """Says on stderr which clips failed, and why."""
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    for name, error in failed:
        console.print(f"Failed: {name}: {error}", markup=False)
