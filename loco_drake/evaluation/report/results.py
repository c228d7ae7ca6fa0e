"""Results on disk: what the ``evaluate`` commands wrote, by robot."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.evaluation.report.expected import EXPECTED, ResultFile
from loco_drake.models.robots import ROBOTS
from loco_drake.models.shipped import pretrained_dir


def results_dir() -> Path:
    """Returns the folder of the results that come with the package."""
    return pretrained_dir() / "results"


@dataclass(frozen=True)
class Figures:
    """Figures of one robot, or a part of them; whatever is read is checked.

    Attributes:
        values: of a JSON object.
        origin: the file, for messages.
    """

    values: dict[str, Any]
    origin: Path

    def part(self, *keys: str) -> "Figures":
        """Returns the object that ``keys`` lead to.

        Raises:
            InputError: if there is none.
        """
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

    def number(self, key: str) -> float | None:
        """Returns a figure; None if it is null, or an older result without it.

        Raises:
            InputError: if it is anything but a finite number.
        """
        value = self.values.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.damaged(f"{key} is {value!r}, not a number")
        if not math.isfinite(value):
            raise self.damaged(f"{key} is {value}")
        return float(value)

    def required(self, key: str) -> float | None:
        """Returns a figure that every result has, though it may be null.

        Raises:
            InputError: if it is not there, or not a finite number.
        """
        if key not in self.values:
            raise self.damaged(f"it has no {key}")
        return self.number(key)

    def numbers(self, *keys: str) -> list[float | None]:
        """Returns the list of numbers, or nulls, that ``keys`` lead to."""
        within, last = self.part(*keys[:-1]), keys[-1]
        values = within.values.get(last)
        if not isinstance(values, list):
            raise self.damaged(f"{'.'.join(keys)} is no list")
        named = Figures({str(i): v for i, v in enumerate(values)}, self.origin)
        return [named.number(str(i)) for i in range(len(values))]

    def strings(self, key: str) -> list[str]:
        """Returns the list of strings that is called ``key``."""
        values = self.values.get(key)
        if not isinstance(values, list) or not all(isinstance(v, str) for v in values):
            raise self.damaged(f"{key} is no list of strings")
        return values

    def matrix(self, key: str, size: int) -> NDArray[np.float64]:
        """Returns the square matrix that is called ``key``, shape (size, size)."""
        try:
            values = np.array(self.values.get(key), float)
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape != (size, size) or not np.isfinite(values).all():
            raise self.damaged(f"{key} is no matrix of {size} rows and columns")
        return values

    def reason(self, key: str) -> str | None:
        """Returns why ``key`` is null, if that is said."""
        reason = self.values.get("reason")
        if isinstance(reason, dict):
            reason = reason.get(key)
        return str(reason) if reason else None

    def damaged(self, why: str) -> InputError:
        """Returns the error that says what is wrong with the file."""
        return InputError(f"{self.origin} is damaged: {why}; write it again.")


@dataclass(frozen=True)
class Results:
    """All results in a folder.

    Attributes:
        folder: where they are.
        found: by file, then by robot.
        missing: expected files that are not there.
        absent: file and robot of figures that a file does not have, and why.
    """

    folder: Path
    found: dict[str, dict[str, Figures]]
    missing: list[ResultFile]
    absent: dict[tuple[str, str], str]

    def of(self, name: str, robot: str) -> Figures | None:
        """Returns the figures of a robot, e.g. of "tokenizer", if there are any.

        Args:
            name: of the file, without robot and suffix, such as "tracking-generated".
            robot: its name.
        """
        files = [file for file in EXPECTED if file.name == name]
        for file in files:
            figures = self.found.get(file.path, {}).get(robot)
            if figures is not None:
                return figures
        return None


def load_results(folder: Path) -> Results:
    """Returns what is in a folder of results.

    Raises:
        InputError: if the folder is not there or has no results, or one is damaged.
    """
    if not folder.is_dir():
        raise InputError(
            f"There is no folder of results {str(folder)!r}; it is to hold "
            f"{', '.join(file.path for file in EXPECTED)}."
        )
    found, missing = {}, []
    absent: dict[tuple[str, str], str] = {}
    for file in EXPECTED:
        path = folder / file.path
        if not path.is_file():
            missing.append(file)
            continue
        found[file.path] = _by_robot(path, file)
        for robot in file.robots:
            figures = found[file.path].get(robot)
            reason = figures.values.get("reason") if figures is not None else None
            if figures is None:
                absent[file.path, robot] = "the file has no figures of this robot"
            elif figures.values.get(file.holds) is None:
                absent[file.path, robot] = str(reason or "no reason is given")
                del found[file.path][robot]
    if not found:
        raise InputError(
            f"There are no results in {str(folder)!r}; it is to hold one or more of "
            f"{', '.join(file.path for file in EXPECTED)}."
        )
    return Results(folder, found, missing, absent)


def _by_robot(path: Path, file: ResultFile) -> dict[str, Figures]:
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path} is damaged: it is no JSON ({error}).") from None
    if not isinstance(content, dict):
        raise InputError(f"{path} is damaged: it holds no JSON object.")
    whole = Figures(content, path)
    if "robots" in content:
        robots = dict(whole.parts("robots"))
    elif content.get("robot") in ROBOTS:
        robots = {content["robot"]: whole}
    else:
        raise InputError(
            f"{path} is damaged: it says of no robot; the choices are "
            f"{', '.join(ROBOTS)}."
        )
    return {name: robots[name] for name in file.robots if name in robots}
