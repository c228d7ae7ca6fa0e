"""Tables of numbers in plain text, read strictly."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.errors import InputError

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
    text = _read_text(Path(path), what)
    lines = text.rstrip().split("\n")
    if not lines[0].strip():
        raise InputError(f"{path} is not {what}: it is empty.")
    for number, line in enumerate(lines, start=1):
        found = line.count(",") + 1
        if found != columns:
            cut = number == len(lines) and number > 1 and found < columns
            hint = "; it seems to be cut off" if cut else ""
            raise InputError(
                f"{path} is not {what}: line {number} has {found} comma-separated "
                f"columns instead of {columns}{hint}."
            )
    values = _parse(lines)
    if values is None:
        number = next(i for i, line in enumerate(lines, 1) if _parse([line]) is None)
        raise InputError(
            f"{path} is not {what}: line {number} holds something that is not a number."
        )
    table = values.reshape(len(lines), columns)
    finite = np.isfinite(table).all(axis=1)
    if not finite.all():
        number = int(np.argmin(finite)) + 1
        raise InputError(f"{path} is not {what}: line {number} holds NaN or infinity.")
    return table


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
