"""What commands print for people and write for programs."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

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
    table = Table(title=title, title_justify="left")
    for index, column in enumerate(columns):
        table.add_column(
            column, justify="right" if index else "left", no_wrap=index == 0
        )
    for row in rows:
        table.add_row(*row)
    console = Console()
    # Rich takes a file or a pipe for a terminal of 80 columns.
    console.print(table, width=None if console.is_terminal else 160)
