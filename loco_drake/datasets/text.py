"""Tables of numbers in plain text, read strictly."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError

# Recordings known here have up to 3 MB, 90 s; this is enough for 25 minutes.
MAX_BYTES = 50_000_000


def read_table(path: Path, columns: int, what: str) -> NDArray[np.float64]:
    """Returns a comma-separated file without header, shape (rows, ``columns``).

    Args:
        path: the file.
        columns: how many numbers each line must hold.
        what: the format, for messages: "a dog keypoint file".

    Raises:
        InputError: if the file cannot be read, is empty, binary or huge, has a line
            with another number of columns (a last line cut off, another delimiter),
            or holds something other than finite numbers.
    """
    table = parse_numbers(read_lines(path, what), 1, columns, path, what)
    finite = np.isfinite(table).all(axis=1)
    if not finite.all():
        number = int(np.argmin(finite)) + 1
        raise InputError(f"{path} is not {what}: line {number} holds NaN or infinity.")
    return table


def read_named_table(
    path: Path, names: Sequence[str], what: str
) -> NDArray[np.float64]:
    """Returns columns of a comma-separated file with a header, NaN where it has gaps.

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
    header, *lines = read_lines(path, what)
    found = [name.strip().strip('"').rstrip("#").lower() for name in header.split(",")]
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
    columns = [found.index(name.lower()) for name in names]
    if np.isinf(table[:, columns]).any():
        number = int(np.argmax(np.isinf(table[:, columns]).any(axis=1))) + 2
        raise InputError(f"{path} is not {what}: line {number} holds infinity.")
    return table[:, columns]


def read_lines(path: Path, what: str) -> list[str]:
    """Returns the lines of a text file, at least one, blank ones at the end left out.

    Raises:
        InputError: if the file cannot be read, is empty, binary or huge.
    """
    lines = _read_text(Path(path), what).rstrip().split("\n")
    if not lines[0].strip():
        raise InputError(f"{path} is not {what}: it is empty.")
    return lines


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
        InputError: if a line has another number of columns, or something other than a
            number (NaN and infinity are numbers).
    """
    for number, line in enumerate(lines, start=first):
        found = line.count(",") + 1
        if found != columns:
            last = first + len(lines) - 1
            cut = number == last and number > 1 and found < columns
            hint = "; it seems to be cut off" if cut else ""
            raise InputError(
                f"{path} is not {what}: line {number} has {found} comma-separated "
                f"columns instead of {columns}{hint}."
            )
    values = _parse(lines)
    if values is None:
        number = next(
            i for i, line in enumerate(lines, first) if _parse([line]) is None
        )
        raise InputError(
            f"{path} is not {what}: line {number} holds something that is not a number."
        )
    return values.reshape(len(lines), columns)


def _read_text(path: Path, what: str) -> str:
    try:
        if not path.is_file():
            raise InputError(f"There is no file {str(path)!r}.")
        if path.stat().st_size > MAX_BYTES:
            raise InputError(
                f"{path} is not {what}: it is larger than {MAX_BYTES // 10**6} MB."
            )
        text = path.read_bytes().decode("ascii")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise InputError(f"{path} is not {what}: it is not plain text.") from None
    if "\0" in text:
        raise InputError(f"{path} is not {what}: it is not plain text.")
    return text.replace("\r\n", "\n")


def _parse(lines: list[str]) -> NDArray[np.float64] | None:
    """Returns all numbers of ``lines``, or None if one is not a number."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.array(",".join(lines).split(","), dtype=np.float64)
    except ValueError:
        return None
