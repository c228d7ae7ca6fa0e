"""Reader of numeric tables in text files, strict and without guessing."""

import re
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError

# Recordings known here have up to 3 MB, 90 s; this is enough for 25 minutes.
MAX_BYTES = 50_000_000
# No coordinate, angle or time of a recording is this large, in any unit.
LARGEST = 1e7

# Byte order marks and their encodings.
_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
_DECIMAL_COMMA = re.compile(r'\d,\d+"?[;\s]\s*"?[-+]?\d+,\d|"[-+]?\d+,\d')


def is_inside(name: str) -> bool:
    """Says whether a relative path, written with ``/``, stays inside its folder.

    Names that another system would take for a drive or a folder are not inside.
    """
    parts = name.split("/")
    return (
        len(name) <= 200
        and not re.search(r"[\x00-\x1f\x7f\\:]", name)
        and all(part.strip(". ") for part in parts)
    )


def read_text(path: Path, what: str) -> str:
    r"""Returns a text file, UTF-8 or with the mark of UTF-16, lines ending in ``\n``.

    Args:
        path: the file.
        what: what it should be, for messages: "a dog keypoint file".

    Raises:
        InputError: if the file cannot be read, is binary or huge.
    """
    try:
        if not path.is_file():
            raise InputError(f"There is no file {str(path)!r}.")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    if len(content) > MAX_BYTES:
        raise InputError(
            f"{path} is not {what}: it is larger than {MAX_BYTES // 10**6} MB."
        )
    encoding = next((_MARKS[m] for m in _MARKS if content.startswith(m)), "utf-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path} is not {what}: it is not plain text.")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_lines(path: Path, what: str) -> list[str]:
    """Returns the lines of a text file, at least one, blank ones at the end left out.

    Raises:
        InputError: if the file cannot be read, is empty, binary or huge.
    """
    lines = read_text(Path(path), what).rstrip().split("\n")
    if not lines[0].strip():
        raise InputError(f"{path} is not {what}: it is empty.")
    return lines


def read_table(path: Path, columns: int, what: str) -> NDArray[np.float64]:
    """Returns a table without header, shape (rows, ``columns``).

    Its columns may be separated by commas, semicolons, tabs or spaces.

    Args:
        path: the file.
        columns: how many numbers each line must hold.
        what: the format, for messages: "a dog keypoint file".

    Raises:
        InputError: if the file cannot be read, is empty, binary or huge, has a line
            with another number of columns (a last line cut off), or holds something
            other than finite numbers.
    """
    lines = _with_commas(read_lines(path, what), path, what)
    table = parse_numbers(lines, 1, columns, path, what)
    finite = np.isfinite(table).all(axis=1)
    if not finite.all():
        number = int(np.argmin(finite)) + 1
        raise InputError(f"{path} is not {what}: line {number} holds NaN or infinity.")
    return table


def read_named_table(
    path: Path, names: Sequence[str], what: str
) -> NDArray[np.float64]:
    """Returns columns of a table with a header, NaN where it has gaps.

    Args:
        path: the file. A field that is empty or ``NaN`` is a gap.
        names: of the columns to return, in this order; quotes around them, upper and
            lower case, and a ``#`` after them do not matter.
        what: the format, for messages.

    Returns:
        Shape (rows, ``len(names)``).

    Raises:
        InputError: if the file cannot be read, lacks a column or all rows, has a line
            with another number of columns than the header, or holds something that is
            neither a number nor a gap.
    """
    header, *lines = _with_commas(read_lines(path, what), path, what)
    found = [name.strip().rstrip("#").lower() for name in header.split(",")]
    missing = [name for name in names if name.lower() not in found]
    if missing:
        raise InputError(
            f"{path} is not {what}: its header lacks {', '.join(missing)}."
        )
    if not lines:
        raise InputError(f"{path} is not {what}: it holds nothing but a header.")
    filled = [
        ",".join(field.strip() or "nan" for field in line.split(",")) for line in lines
    ]
    table = parse_numbers(filled, 2, len(found), path, what)
    return table[:, [found.index(name.lower()) for name in names]]


def parse_numbers(
    lines: list[str], first: int, columns: int, path: Path, what: str
) -> NDArray[np.float64]:
    """Returns the numbers of comma-separated lines, shape (lines, ``columns``).

    Args:
        lines: some of the file's, at least one.
        first: number of the first of them in the file, for messages.
        columns: how many numbers each must hold.
        path: the file, for messages.
        what: its format, for messages.

    Raises:
        InputError: if a line has another number of columns, something other than a
            number (NaN is one), or one beyond :data:`LARGEST`.
    """
    for number, line in enumerate(lines, start=first):
        found = line.count(",") + 1
        if found != columns:
            last = first + len(lines) - 1
            cut = number == last and number > 1 and found < columns
            hint = "; it seems to be cut off" if cut else ""
            raise InputError(
                f"{path} is not {what}: line {number} has {found} columns instead of "
                f"{columns}{hint}."
            )
    values = _parse(lines)
    if values is None:
        number = next(
            i for i, line in enumerate(lines, first) if _parse([line]) is None
        )
        raise InputError(
            f"{path} is not {what}: line {number} holds something that is not a number."
        )
    values = values.reshape(len(lines), columns)
    large = (np.abs(values) > LARGEST).any(axis=1)
    if large.any():
        number = first + int(np.argmax(large))
        value = values[number - first][np.abs(values[number - first]) > LARGEST][0]
        raise InputError(
            f"{path} is not {what}: line {number} holds "
            f"{'NaN or infinity' if np.isinf(value) else f'{value:g}'}."
        )
    return values


def refuse_decimal_commas(text: str, path: Path, what: str) -> None:
    """Raises InputError if the numbers of a line are written with decimal commas."""
    if _DECIMAL_COMMA.search(text):
        raise InputError(
            f"{path} is not {what}: its numbers have decimal commas, but must be "
            "written with points."
        )


def _with_commas(lines: list[str], path: Path, what: str) -> list[str]:
    """Returns the lines of a table, separated by commas and without quotes."""
    while len(lines) > 1 and not lines[-1].strip(
        ',;\t "'
    ):  # as spreadsheets write empty rows
        lines.pop()
    for line in lines[:2]:
        refuse_decimal_commas(line, path, what)
    if "," in lines[0]:
        separator = ","
    elif ";" in lines[0]:
        separator = ";"
    else:
        return [",".join(line.split()).replace('"', "") for line in lines]
    return [line.replace('"', "").replace(separator, ",") for line in lines]


def _parse(lines: list[str]) -> NDArray[np.float64] | None:
    """Returns all numbers of ``lines``, or None if one is not a number."""
    text = ",".join(lines)
    if "_" in text:  # which Python would skip
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.array(text.split(","), dtype=np.float64)
    except ValueError:
        return None
