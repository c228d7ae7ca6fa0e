"""Tables of points: three columns for each, under headers of many kinds, or none.

A header may have one row (``Paw_x,Paw_y,Paw_z``) or several (names over coordinates, as
in exports of motion capture). Cells left blank in it repeat the cell to their left.
Points of a table without a header are numbered from 0.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, quoted
from loco_drake.common.files import parse_number
from loco_drake.datasets.recording import (
    RATES,
    parse_numbers,
    refuse_decimal_commas,
)

_AXES = "xyz"
# Rows before the first of numbers that can be a header.
_MOST_HEADERS = 12

_AXIS = re.compile(r"([xyzXYZ])\d*")
# A name before or behind its axis: paw_x, PawX, x_paw.
_BEHIND = re.compile(r"(.+?)[\s_.:-]*([xyzXYZ])\d*")
_BEFORE = re.compile(r"([xyzXYZ])[\s_.:-]+(.+)")
_TIME = re.compile(r"(?i)(time|t|timestamps?|sec|seconds)\b.*|time_?(s|ms)")
# A step of time is even to this share.
_EVEN = 0.2


@dataclass(frozen=True)
class PointTable:
    """A table and where its points are."""

    values: Array  # all columns, NaN for gaps and text, shape (T, C)
    points: dict[str, tuple[int, int, int]]  # columns of x, y and z, by name
    time: int | None  # column of the time

    def positions(self) -> Array:
        """Returns the points, shape (T, N, 3)."""
        columns = np.array(list(self.points.values()), dtype=int).reshape(-1, 3)
        positions: Array = self.values[:, columns]
        return positions

    @property
    def fps(self) -> float | None:
        """Rate by the time, in s or ms; None without one, or if it is uneven."""
        if self.time is None or len(self.values) < 2:
            return None
        steps = np.diff(self.values[:, self.time])
        step = float(np.median(steps))
        if not step > 0 or not (np.abs(steps - step) < _EVEN * step).all():
            return None
        mean = float(steps.mean())
        low, high = RATES
        for unit in (1.0, 1e-3):
            rate = 1 / (unit * mean)
            if low <= rate <= high:
                whole = float(round(rate))
                return whole if abs(whole / rate - 1) < 0.005 else rate
        return None


def parse_point_table(
    lines: list[str], columns: Mapping[str, Sequence[str | int]]
) -> PointTable:
    """Returns the table in the lines of a file; see :func:`named_points.read_points`.

    Raises:
        InputError: if it holds no points, or lines of unequal length.
    """
    header, rows, first = _split(lines)
    width = len(rows[0])
    named = [_column_name([row[k] for row in header]) for k in range(width)]
    values = _numbers(rows, first, width)
    points = _named_points(header) if header else {}
    time = next((k for k, name in enumerate(named) if _TIME.fullmatch(name)), None)
    if not header:
        points, time = _numbered_points(values)
    for name, three in columns.items():
        if len(three) != 3:
            raise InputError(f"columns of {quoted(name)} must be three, x, y and z.")
        x, y, z = (_column(cell, named, width) for cell in three)
        points[name] = x, y, z
    if not points:
        there = ", ".join(filter(None, named[:60])) or f"{width} columns without header"
        raise InputError(
            f"its columns are no points (name_x, name_y, name_z), but {there}; name "
            "those of each point under columns."
        )
    return PointTable(values, points, time)


def _split(lines: list[str]) -> tuple[list[list[str]], list[list[str]], int]:
    """Returns cells of header and rows, all of one width, and the first row's line."""
    numeric = [k for k, line in enumerate(lines) if _is_numeric(line)]
    if not numeric or numeric[0] > _MOST_HEADERS:
        raise InputError("it is neither BVH nor a table of numbers.")
    refuse_decimal_commas(lines[numeric[-1]])
    separator = next((s for s in ",;\t" if s in lines[numeric[-1]]), None)
    split = [line.replace('"', "").split(separator) for line in lines]
    while len(split) > 1 and not "".join(split[-1]).strip():
        split.pop()
    counts = Counter(len(split[k]) for k in numeric)
    width = counts.most_common(1)[0][0]
    # Numbers above a header tell of the recording.
    first = next(k for k in numeric if len(split[k]) == width)
    first = first if any(k not in numeric for k in range(first)) else 0
    header = [_filled(row, width) for row in split[:first] if len(row) > 1]
    for number, row in enumerate(split[first:], first + 1):
        if len(row) != width:
            raise InputError(
                f"line {number} has {len(row)} columns instead of {width}."
            )
    return header, split[first:], first + 1


def _is_numeric(line: str) -> bool:
    """Whether most cells of a line are numbers or blank, and more than one a number."""
    cells = [cell.strip() for cell in re.split(r"[,;\s]", line.replace('"', ""))]
    numbers = sum(map(_is_number, cells))
    return numbers > 1 and 2 * numbers > sum(map(bool, cells))


def _is_number(cell: str) -> bool:
    try:
        parse_number(cell)
    except ValueError:
        return False
    return True


def _filled(row: list[str], width: int) -> list[str]:
    """Returns the cells of a row of the header, blank ones as the one before them."""
    cells = [cell.strip() for cell in [*row, *[""] * width]][:width]
    for k in range(1, width):
        cells[k] = cells[k] or cells[k - 1]
    return cells


def _column_name(cells: list[str]) -> str:
    """Returns the lowest cell of a column's header that is more than an axis."""
    names = [cell for cell in cells if len(cell) > 1]
    return (names or cells or [""])[-1]


def _numbers(rows: list[list[str]], first: int, width: int) -> Array:
    """Returns the numbers, NaN in columns of text."""
    text = [not (_is_number(cell) or not cell.strip()) for cell in rows[0]]
    lines = [
        ",".join(
            "nan" if skip or not cell.strip() else cell.strip()
            for cell, skip in zip(row, text, strict=True)
        )
        for row in rows
    ]
    return parse_numbers(lines, first, width, gaps=True)


def _named_points(header: list[list[str]]) -> dict[str, tuple[int, int, int]]:
    """Returns the columns of each point that a header names.

    One of its rows has names with axes, or the axes of names in a row above.
    """
    found: list[dict[str, tuple[int, int, int]]] = []
    for row, cells in enumerate(header):
        found.append(_group([_suffixed(cell) for cell in cells]))
        axes = [_AXIS.fullmatch(cell) for cell in cells]
        for names in header[:row]:
            pairs = zip(names, axes, strict=True)
            found.append(
                _group([(k, axis[1].lower()) if axis else None for k, axis in pairs])
            )
    return max(found, key=len)


def _suffixed(cell: str) -> tuple[str, str] | None:
    """Returns name and axis of a cell such as ``paw_x``."""
    if match := _BEHIND.fullmatch(cell):
        return match[1], match[2].lower()
    if match := _BEFORE.fullmatch(cell):
        return match[2], match[1].lower()
    return None


def _group(cells: list[tuple[str, str] | None]) -> dict[str, tuple[int, int, int]]:
    """Returns columns x, y, z by name, of the names that have each exactly once."""
    found: dict[str, dict[str, list[int]]] = {}
    for column, cell in enumerate(cells):
        if cell is not None:
            name, axis = cell
            found.setdefault(name, {}).setdefault(axis, []).append(column)
    return {
        name: (axes["x"][0], axes["y"][0], axes["z"][0])
        for name, axes in found.items()
        if set(axes) == set(_AXES) and all(len(k) == 1 for k in axes.values())
    }


def _numbered_points(
    values: Array,
) -> tuple[dict[str, tuple[int, int, int]], int | None]:
    """Returns points of a table without a header, and the column of its time.

    Columns before the points count frames or time: they rise evenly.
    """
    skipped, time = 0, None
    while values.shape[1] % 3 != skipped % 3 and skipped < 2:
        steps = np.diff(values[:, skipped])
        if not (len(steps) and (steps > 0).all() and np.ptp(steps) < 0.5 * steps[0]):
            return {}, None
        if abs(steps[0] - 1) > 1e-6:
            time = skipped
        skipped += 1
    starts = range(skipped, values.shape[1], 3)
    return {str(n): (k, k + 1, k + 2) for n, k in enumerate(starts)}, time


def _column(cell: str | int, named: list[str], width: int) -> int:
    if isinstance(cell, int):
        if 0 <= cell < width:
            return cell
        raise InputError(f"it has {width} columns, counted from 0, and none {cell}.")
    if cell in named:
        return named.index(cell)
    raise InputError(
        f"it has no column {quoted(cell)}, but {', '.join(filter(None, named[:60]))}."
    )
