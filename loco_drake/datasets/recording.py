"""Recording, the result of a reader; Body, the bounds of its source; numeric tables.

Many forms of a table are read, none is guessed at. Reasons to refuse a file do not name
it: :func:`loco_drake.datasets.registry.read_clip` does.
"""

import re
from collections.abc import Sequence, Sized
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.errors import InputError
from loco_drake.common.files import read_text

# Plausible rates of cameras and simulators, frames/s.
RATES = (10.0, 1000.0)
# Needed for interpolation.
MIN_FRAMES = 4
# No coordinate, angle or time of a recording is this large, in any unit.
LARGEST = 1e7

_DECIMAL_COMMA = re.compile(r'\d,\d+"?[;\s]\s*"?[-+]?\d+,\d|"[-+]?\d+,\d')


@dataclass(frozen=True)
class Recording:
    """Six points of an animal or robot over a whole file, in metres.

    Up axis, ground and the order of toes need not follow the conventions, since
    :mod:`loco_drake.datasets.conventions` measures them.
    """

    points: Array  # withers, hip, toes FL, FR, RL, RR, shape (T, 6, 3)
    fps: float  # frames per second
    first: int = 0  # number in the file of the first of these frames
    # Number in the file of the first usable frame, the default start.
    start: int | None = None
    # Corrections, for the clip's provenance.
    notes: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Body:
    """Bounds that all recordings of a source satisfy."""

    # Range of the distance between withers and hip, m.
    trunk: tuple[float, float] = (0.03, 5.0)
    # Range of the height of the trunk's middle over the toes in stance, m.
    height: tuple[float, float] = (0.03, 5.0)
    # Range of the stride period, in units of sqrt(height / g).
    stride: tuple[float, float] = (0.5, 10.0)
    # Largest deviation of a toe from linear extrapolation of its last two frames, as a
    # share of the larger of trunk and height.
    jump: float = 0.4
    # Whether toes are markers with individual height offsets, rather than exact points.
    markers: bool = True


def check_rate(fps: float) -> float:
    """Returns a rate in frames/s; raises InputError if it is not plausible."""
    low, high = RATES
    if not low <= fps <= high:
        raise InputError(
            f"{fps:g} frames/s is not plausible: a rate is {low:g} to {high:g} "
            "frames/s (is a time in ms, or a step given for a rate?)."
        )
    return fps


def check_told(told: float, fps: float | None) -> float:
    """Returns the rate inferred from the motion, or the given one if it agrees.

    Raises InputError if they differ by more than a third.
    """
    if fps is not None and not 0.75 < fps / told < 4 / 3:
        raise InputError(
            f"at {fps:g} frames/s it is none, as its motion implies "
            f"{told:g}; omit the rate or correct it."
        )
    return told if fps is None else fps


def check_frames(frames: Sized) -> None:
    """Raises InputError if there are fewer than :data:`MIN_FRAMES` frames."""
    if len(frames) < MIN_FRAMES:
        raise InputError(f"it needs at least {MIN_FRAMES} frames, not {len(frames)}.")


def check_range(start: int | None, end: int | None, frames: int) -> tuple[int, int]:
    """Returns ``(start, end)`` of a stretch, ``end`` exclusive.

    None stands for the first frame, or for the frame after the last. Raises InputError
    if the stretch does not lie within ``frames`` frames.
    """
    first = 0 if start is None else start
    stop = frames if end is None else end
    if not 0 <= first < stop <= frames:
        raise InputError(
            f"frames {first} to {stop} (exclusive) do not lie within the file, which "
            f"has {frames} frames."
        )
    return first, stop


def all_seen(points: Array) -> Bools:
    """Returns in which frames (T,) of ``points`` (T, ...) nothing is missing."""
    flat = points.reshape(len(points), -1)
    return np.asarray(np.isfinite(flat).all(axis=1), dtype=np.bool_)


def read_lines(path: Path) -> list[str]:
    """Returns the lines of a text file, at least one, blank ones at the end left out.

    Raises:
        InputError: if the file cannot be read, is empty, binary or huge.
    """
    lines = read_text(path).rstrip().split("\n")
    if not lines[0].strip():
        raise InputError("it is empty.")
    return lines


def read_table(path: Path, columns: int) -> Array:
    """Returns a table without header, shape (rows, ``columns``).

    Its columns may be separated by commas, semicolons, tabs or spaces.

    Raises:
        InputError: if the file cannot be read, a line has another number of columns (a
            last line cut off), or holds something other than finite numbers.
    """
    return parse_numbers(_with_commas(read_lines(path)), 1, columns)


def read_named_table(path: Path, names: Sequence[str]) -> Array:
    """Returns columns of a table with a header, shape (rows, ``len(names)``).

    They are in the order of ``names``; quotes around these in the file, upper and lower
    case, and a ``#`` after them do not matter. A field that is empty or ``NaN`` is NaN.

    Raises:
        InputError: if the file cannot be read, a column or all rows are lacking, a line
            has another number of columns than the header, or something that is neither
            a number nor a gap.
    """
    header, *rows = _with_commas(read_lines(path))
    found = [name.strip().rstrip("#").lower() for name in header.split(",")]
    missing = [name for name in names if name.lower() not in found]
    if missing:
        raise InputError(f"its header lacks {', '.join(missing)}.")
    if not rows:
        raise InputError("it holds nothing but a header.")
    rows = [",".join(f.strip() or "nan" for f in row.split(",")) for row in rows]
    table = parse_numbers(rows, 2, len(found), gaps=True)
    return table[:, [found.index(name.lower()) for name in names]]


def parse_numbers(
    lines: list[str], first: int, columns: int, gaps: bool = False
) -> Array:
    """Returns the numbers of comma-separated lines, shape (lines, ``columns``).

    ``first`` is the number of the first line in its file; ``gaps`` allows NaN.

    Raises:
        InputError: if a line has another number of columns, something other than a
            finite number, or one beyond :data:`LARGEST`.
    """
    for number, line in enumerate(lines, first):
        found = line.count(",") + 1
        if found != columns:
            cut = number == first + len(lines) - 1 and number > 1 and found < columns
            raise InputError(
                f"line {number} has {found} columns instead of {columns}"
                + ("; it seems to be cut off." if cut else ".")
            )
    values = _parse(lines)
    if values is None:
        unread = (n for n, line in enumerate(lines, first) if _parse([line]) is None)
        raise InputError(f"line {next(unread)} holds something that is not a number.")
    wrong = ~(np.abs(values) <= LARGEST) & ~(gaps & np.isnan(values))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        value = values[row, column]
        shown = f"{value:g}" if np.isfinite(value) else "NaN or infinity"
        raise InputError(f"line {first + row} holds {shown}.")
    return values


def _parse(lines: list[str]) -> Array | None:
    """Returns the numbers in ``lines``, or None if there is something else."""
    try:
        return np.loadtxt(lines, delimiter=",", comments=None, ndmin=2)
    except ValueError:
        return None


def refuse_decimal_commas(text: str) -> None:
    """Raises InputError if the numbers of a line are written with decimal commas."""
    if _DECIMAL_COMMA.search(text):
        raise InputError(
            "its numbers have decimal commas, but must be written with points."
        )


def _with_commas(lines: list[str]) -> list[str]:
    """Returns the lines of a table, separated by commas and without quotes."""
    # Spreadsheets write empty rows.
    while len(lines) > 1 and not lines[-1].strip(',;\t "'):
        lines.pop()
    for line in lines[:2]:
        refuse_decimal_commas(line)
    separator = next((s for s in ",;" if s in lines[0]), None)
    plain = (line.replace('"', "") for line in lines)
    return [",".join(line.split(separator)) for line in plain]
