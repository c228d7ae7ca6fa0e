"""The table ``segments.csv``: the one that is shipped, and that of a data folder."""

import csv
from collections.abc import Iterable
from pathlib import Path

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path

SHIPPED = Path(__file__).with_name("segments.csv")
COLUMNS = ("dataset", "file", "gait", "start_frame", "end_frame", "fps")

Row = dict[str, str]


def read_rows(table: Path) -> list[Row]:
    """Returns the rows of a table, without checking what their cells hold.

    Raises:
        FileNotFoundError: if there is no such file.
        InputError: if it is not a CSV table, or a row lacks one of ``COLUMNS``.
    """
    try:
        with table.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{table} is damaged: it is not a CSV table.") from None
    for line, row in enumerate(rows, start=2):
        missing = [name for name in COLUMNS if not row.get(name)]
        if missing:
            raise InputError(f"{table}: line {line} lacks {', '.join(missing)}.")
        if None in row:
            raise InputError(f"{table}: line {line} has more cells than the header.")
    return rows


def write_rows(table: Path, rows: Iterable[Row]) -> None:
    """Writes a table with the columns of all rows."""
    rows = list(rows)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with (
        atomic_path(table) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def add_shipped_rows(rows: Iterable[Row], files: Iterable[str]) -> list[Row]:
    """Returns a table with the shipped stretches of some files added.

    A file that the table already speaks of keeps the rows that it has there, which may
    be the user's own. The order is that of the shipped table, whatever was added first;
    rows of other files come last.

    Args:
        rows: the table so far.
        files: names of files inside the data folder, such as
            ``dog_mann/keypoints/dog_walk00.txt``.
    """
    own = _by_file(rows)
    added = set(files)
    merged = []
    for name, stretches in _by_file(read_rows(SHIPPED)).items():
        if name in own:
            merged += own.pop(name)
        elif name in added:
            merged += stretches
    return merged + [row for stretches in own.values() for row in stretches]


def _by_file(rows: Iterable[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(f"{row['dataset']}/{row['file']}", []).append(row)
    return found
