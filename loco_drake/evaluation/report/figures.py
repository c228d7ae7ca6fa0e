"""The figures in a file of results; what is no figure is reported as damage."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError

_GREATEST = 1e12  # no figure is beyond that


@dataclass(frozen=True)
class Figures:
    """Figures of one robot, or a part of them.

    Every method raises InputError where the file holds something else.
    """

    values: dict[str, Any]  # of a JSON object
    origin: Path = Path()  # the file, for messages

    def part(self, *keys: str) -> "Figures":
        """Returns the object that ``keys`` lead to."""
        value: Any = self.values
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if not isinstance(value, dict):
            raise self.damaged(f"it has no {'.'.join(keys)}")
        return Figures(value, self.origin)

    def parts(self, *keys: str) -> Iterator[tuple[str, "Figures"]]:
        """Yields name and figures of each object within an object."""
        within = self.part(*keys)
        for name in within.values:
            yield name, within.part(name)

    def extreme(
        self, pick: Callable[..., Any], key: str, *keys: str
    ) -> tuple[float, str] | None:
        """Returns the least or greatest of a figure of all parts, and whose it is."""
        found = [
            (value, name)
            for name, part in self.parts(*keys)
            if (value := part.required(key)) is not None
        ]
        worst: tuple[float, str] | None = pick(found, default=None)
        return worst

    def number(self, key: str) -> float | None:
        """Returns a figure; None if it is null, or an older result without it."""
        value = self.values.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.damaged(f"{key} is {value!r}, not a number")
        if not -_GREATEST <= value <= _GREATEST:  # NaN is not, either
            raise self.damaged(f"{key} is {value}")
        return float(value)

    def required(self, key: str) -> float | None:
        """Returns a figure that every result has, though it may be null."""
        if key not in self.values:
            raise self.damaged(f"it has no {key}")
        return self.number(key)

    def numbers(self, *keys: str) -> list[float | None]:
        """Returns the list of numbers, or nulls, that ``keys`` lead to."""
        values = self.part(*keys[:-1]).values.get(keys[-1])
        if not isinstance(values, list):
            raise self.damaged(f"{'.'.join(keys)} is no list")
        named = Figures({str(k): v for k, v in enumerate(values)}, self.origin)
        return list(map(named.number, named.values))

    def entry(self, key: str) -> float | None:
        """Returns a figure, or entry k of the list ``name`` for the key "name[k]".

        It is None where :meth:`number` is, and of an empty list.
        """
        name, _, index = key.removesuffix("]").partition("[")
        if not index:
            return self.number(name)
        values = self.numbers(name)
        if not values:
            return None
        if not -len(values) <= int(index) < len(values):
            raise self.damaged(f"{name} has no entry {index}")
        return values[int(index)]

    def objects(self, key: str) -> list["Figures"]:
        """Returns the objects of the list that is called ``key``."""
        values = self.values.get(key)
        if not isinstance(values, list):
            raise self.damaged(f"{key} is no list")
        if not all(isinstance(value, dict) for value in values):
            raise self.damaged(f"{key} has an entry that is no object")
        return [Figures(value, self.origin) for value in values]

    def vector(self, key: str, size: int) -> Array | None:
        """Returns the list of ``size`` numbers that is called ``key``, or None."""
        if self.values.get(key) is None:
            return None
        values = self.numbers(key)
        if len(values) != size or None in values:
            raise self.damaged(f"{key} is no list of {size} numbers")
        return np.array(values, float)

    def pairs(self, key: str) -> Array:
        """Returns the list of pairs of numbers that is called ``key``, shape (N, 2)."""
        try:
            values = np.array(self.values.get(key), float)
        except (TypeError, ValueError, OverflowError):
            values = np.empty(())
        if values.shape == (0,):
            return np.empty((0, 2))
        if values.ndim != 2 or values.shape[1] != 2 or not _bounded(values):
            raise self.damaged(f"{key} is no list of pairs of numbers")
        return values

    def flag(self, key: str) -> bool:
        """Returns whether ``key`` is true."""
        value = self.values.get(key)
        if not isinstance(value, bool):
            raise self.damaged(f"{key} is {value!r}, not true or false")
        return value

    def text(self, key: str) -> str:
        """Returns a string, empty where there is none."""
        value = self.values.get(key)
        if not isinstance(value, str | None):
            raise self.damaged(f"{key} is {value!r}, not a string")
        return value or ""

    def matrix(self, key: str, size: int) -> Array:
        """Returns the square matrix that is called ``key``, shape (size, size)."""
        try:
            values = np.array(self.values.get(key), float)
        except (TypeError, ValueError, OverflowError):
            values = np.empty(0)
        if values.shape != (size, size) or not (np.abs(values) <= 1).all():
            raise self.damaged(f"{key} is no matrix of {size} rows of shares")
        return values

    def reason(self, key: str) -> str:
        """Returns why ``key`` is null, as far as that is said."""
        reason = self.values.get("reason")
        if isinstance(reason, dict):
            reason = reason.get(key)
        return str(reason or "")

    def damaged(self, why: str) -> InputError:
        """Returns the error that says what is wrong with the file."""
        # What is quoted comes from the file: it may be long, or control a terminal.
        shown = "".join(filter(str.isprintable, why[:200])) + "..." * (len(why) > 200)
        return InputError(f"{self.origin} is damaged: {shown}; write it again.")


def _bounded(values: Array) -> bool:
    return bool((np.abs(values) <= _GREATEST).all())  # NaN is not, either
