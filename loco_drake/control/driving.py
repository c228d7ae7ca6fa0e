"""Orders to a robot over time: what a driver's hands or a table say.

The orders of one moment are a row of ORDERS numbers: the command (forward and sideways
m/s, yaw rate rad/s, in the heading frame), the gait's index in LABELS or ANY_INDEX, and
two things that happen in one control period only: a push of the trunk to its left, N s,
and a reset, 1 or 0.
"""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.errors import InputError, check_number, quoted
from loco_drake.common.files import parse_number, read_text
from loco_drake.control.command import ANY_COMMAND
from loco_drake.control.plan import PLAN_DT
from loco_drake.motion.gaits import gait_index

COMMAND = np.s_[..., :3]
GAIT, PUSH, RESET = 3, 4, 5
ORDERS = 6

MOST_PUSH = 100.0  # N s; a quarter of it topples any of the robots
COLUMNS = ("time", "forward", "sideways", "yaw_rate", "gait", "push", "reset")
_NEEDED = COLUMNS[:4]
_MOST_ROWS = 1_000_000
_TOLERANCE = 1e-6  # s; context times are sums of steps


@dataclass(frozen=True, eq=False)
class OrderTable:
    """Orders that change at given times, the first at 0 s."""

    times: Array  # s, ascending, shape (N,)
    rows: Array  # shape (N, ORDERS)

    def index(self, times: Array) -> Integers:
        """Returns the row that is in force at each of ``times`` (N,), s."""
        found = np.searchsorted(self.times, times + _TOLERANCE, side="right")
        return np.maximum(found - 1, 0)

    def at(self, time: float) -> Array:
        """Returns the orders in the control period that begins at ``time``, (ORDERS,).

        Command and gait last until the next row, a push and a reset for one period.
        """
        before, now = np.searchsorted(
            self.times, np.array([time - PLAN_DT, time]) + _TOLERANCE, side="right"
        )
        orders: Array = self.rows[max(now - 1, 0)].copy()
        recent = self.rows[before:now]
        orders[PUSH] = recent[:, PUSH].sum()
        orders[RESET] = recent[:, RESET].max(initial=0.0)
        return orders


def check_command(command: Sequence[float]) -> Array:
    """Returns a command as an array, shape (3,).

    Raises:
        InputError: if a number is not finite or beyond ANY_COMMAND.
    """
    for name, value, most in zip(_NEEDED[1:], command, ANY_COMMAND.high, strict=True):
        what = f"A command's {name.replace('_', ' ')}"
        check_number(what, value, -most, most)
    return np.array(command, dtype=np.float64)


def check_orders(values: Sequence[float | str]) -> Array:
    """Returns orders as a row, given in the order of COLUMNS without the time.

    Raises:
        InputError: if a value is out of its bounds or a gait unknown.
    """
    *numbers, gait, push, reset = values
    command = check_command(numbers)  # type: ignore[arg-type]
    check_number("A push", push, -MOST_PUSH, MOST_PUSH)
    if reset not in (0, 1):
        raise InputError(f"A reset must be 0 or 1, not {quoted(reset)}.")
    return np.array([*command, gait_index(str(gait)), push, reset], dtype=np.float64)


def order_table(times: Sequence[float], rows: Sequence[Array]) -> OrderTable:
    """Returns a table of orders.

    Raises:
        InputError: if there is no row, or the times do not ascend from 0 s.
    """
    if not 1 <= len(times) <= _MOST_ROWS:
        raise InputError(
            f"A table of commands must have 1 to {_MOST_ROWS} rows, not {len(times)}."
        )
    before = -1.0
    for time in times:
        check_number("The time of a command", time, 0.0)
        if time <= before:
            raise InputError(
                f"The times of commands must rise, and {time:g} s comes after "
                f"{before:g} s."
            )
        before = time
    return OrderTable(np.array(times, dtype=np.float64), np.array(rows))


def read_commands(path: Path, gait: str) -> OrderTable:
    """Reads a table of times and commands.

    The file is CSV. Its first line names the columns: time (s), forward, sideways
    (m/s), yaw_rate (rad/s), and if wanted gait, push (N s) and reset. Where a gait is
    empty, the one before goes on.

    Args:
        path: the file.
        gait: the gait at the beginning.

    Raises:
        InputError: if the file cannot be read or a value is amiss; the message names
            the line.
    """
    try:
        lines = list(csv.reader(io.StringIO(read_text(path))))
    except csv.Error as error:
        raise InputError(f"{path} is no table of commands: {error}.") from None
    names = [name.strip() for name in lines[0]] if lines else []
    known = set(names) <= set(COLUMNS) and len(set(names)) == len(names)
    if not known or not set(_NEEDED) <= set(names):
        raise InputError(
            f"{path} is no table of commands: its first line must name the columns "
            f"{', '.join(_NEEDED)} and may name {', '.join(COLUMNS[4:])}."
        )
    if not any(cell.strip() for line in lines[1:] for cell in line):
        raise InputError(f"{path} is no table of commands: it lists none.")
    # Until the first row the robot stays where it is.
    times, rows = [0.0], [check_orders([0, 0, 0, gait, 0, 0])]
    for number, line in enumerate(lines[1:], 2):
        if not any(cell.strip() for cell in line):
            continue
        try:
            if len(line) != len(names):
                raise InputError(f"There are {len(line)} cells for {len(names)} names.")
            cells = dict(zip(names, (cell.strip() for cell in line), strict=True))
            gait = cells.get("gait") or gait
            time, *command = (_number(name, cells[name]) for name in _NEEDED)
            push, reset = (_number(k, cells.get(k) or "0") for k in COLUMNS[5:])
            row = check_orders([*command, gait, push, reset])
            if len(times) == 1 and time == 0:
                times, rows = [], []
            order_table([*times[-1:], time], [])
        except InputError as error:
            raise InputError(f"{path}, line {number}: {error}") from None
        times.append(time)
        rows.append(row)
    return order_table(times, rows)


def _number(name: str, text: str) -> float:
    """Returns the number in a cell.

    Raises:
        InputError: if it is no finite number.
    """
    try:
        value = parse_number(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"The {name} must be a finite number, not {quoted(text)}.")
    return value
