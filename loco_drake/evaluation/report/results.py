"""Results on disk, written by the ``evaluate`` commands, by robot.

Everything that is read is checked; unexpected content is reported as damage in one
sentence.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.files import figures_sha256, read_json
from loco_drake.evaluation.report.content import CONTENT
from loco_drake.models.robots import ROBOTS
from loco_drake.models.shipped import pretrained_dir

_GREATEST = 1e12  # no figure is beyond that


@dataclass(frozen=True)
class ResultFile:
    """A file of results."""

    name: str  # without robot and suffix
    robots: tuple[str, ...]  # whose figures it is to hold; its own, or all of them
    command: str  # writes it, but for --json
    flags: str = ""  # the part of command that figures of tracking do not tell
    # A key that all figures of a robot have; null where there are none.
    holds: str = "labels"
    suffix: str = ".json"

    @property
    def path(self) -> str:
        """Its name in the folder of results."""
        if len(self.robots) > 1:
            return f"{self.name}{self.suffix}"
        kind, _, condition = self.name.partition("-")
        return "-".join(filter(None, (kind, *self.robots, condition))) + ".json"


_TRACKING = "loco-drake evaluate tracking --robot"


def tracking_name(condition: str, policy: str = "") -> str:
    """Returns the name of the results of a shipped policy under a condition."""
    of_policy = f"{policy}_policy" if policy else ""
    return "-".join(filter(None, ("tracking", of_policy, condition)))


def _expected() -> Iterator[ResultFile]:
    for result in CONTENT.results:
        each = [(robot,) for robot in ROBOTS]
        for robots in each if "{robot}" in result.command else [ROBOTS]:
            command = f"loco-drake {result.command.format(robot=robots[0])}"
            yield ResultFile(result.name, robots, command, holds=result.holds)
    for policy in CONTENT.policies:
        asked = ["--policy", policy.name] if policy.name else []
        names = CONTENT.worlds if policy.name else CONTENT.conditions
        for robot, name in product(policy.robots, names):
            options = CONTENT.conditions[name].options.split()
            flags = [o for o in options if o in ("--randomize", "--pushes")]
            yield ResultFile(
                tracking_name(name, policy.name),
                (robot,),
                " ".join((_TRACKING, robot, *asked, *options)),
                " ".join((*asked, *flags)),
            )


EXPECTED = tuple(_expected())
# The robots in a gait, with the keypoints of the recording: a picture.
RETARGETED = ResultFile(
    "retargeted-dog-pace",
    ROBOTS,
    "loco-drake evaluate retargeting --robot all --labels dog-pace --figures FOLDER",
    suffix=".webp",
)


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


@dataclass(frozen=True)
class Results:
    """All results in a folder."""

    folder: Path  # where they are; RETARGETED is there, too, or among the missing
    found: dict[str, dict[str, Figures]]  # by file, then by robot
    missing: list[ResultFile]  # files that are not there
    # File and robot of figures that a file does not have, and why.
    absent: dict[tuple[str, str], str]

    def of(self, name: str, robot: str) -> Figures | None:
        """Returns the figures of a robot, if there are any.

        ``name`` is that of the file without robot and suffix: "tracking-generated".
        """
        files = [file.path for file in EXPECTED if file.name == name]
        found = (self.found.get(path, {}).get(robot) for path in files)
        return next(filter(None, found), None)

    def of_robots(self, name: str) -> dict[str, Figures]:
        """Returns the figures of each robot that ``name`` has some of."""
        found = {robot: self.of(name, robot) for robot in ROBOTS}
        return {robot: own for robot, own in found.items() if own is not None}


def results_dir() -> Path:
    """Returns the folder of the results that come with the package."""
    return pretrained_dir() / "results"


def load_results(folder: Path) -> Results:
    """Returns what is in a folder of results.

    Raises:
        InputError: if the folder is not there or has no results, or one is damaged.
    """
    names = ", ".join(file.path for file in EXPECTED)
    if not folder.is_dir():
        raise InputError(
            f"There is no folder of results {str(folder)!r}; it is to hold {names}."
        )
    every = (*EXPECTED, RETARGETED)
    missing = [file for file in every if not (folder / file.path).is_file()]
    found: dict[str, dict[str, Figures]] = {}
    absent: dict[tuple[str, str], str] = {}
    for file in (file for file in EXPECTED if file not in missing):
        found[file.path] = by_robot = _by_robot(folder / file.path, file)
        for robot in file.robots:
            if robot not in by_robot:
                absent[file.path, robot] = "the file has no figures of this robot"
            elif by_robot[robot].values.get(file.holds) is None:
                reason = by_robot.pop(robot).values.get("reason")
                absent[file.path, robot] = str(reason or "no reason is given")
    if not found:
        raise InputError(
            f"There are no results in {str(folder)!r}; it is to hold one or more of "
            f"{names}."
        )
    return Results(folder, found, missing, absent)


def _by_robot(path: Path, file: ResultFile) -> dict[str, Figures]:
    whole = Figures(read_json(path), path)
    written = whole.text("sha256")
    if written and written != figures_sha256(whole.values):
        raise whole.damaged("its figures are not those that were written")
    if "robots" in whole.values:
        robots = dict(whole.parts("robots"))
    elif whole.text("robot") in ROBOTS:
        robots = {whole.text("robot"): whole}
    else:
        raise whole.damaged(f"it says of no robot; the choices are {', '.join(ROBOTS)}")
    return {name: robots[name] for name in file.robots if name in robots}


# Conditions in results of tracking: key, option, and what needs no option.
_OPTIONS = (
    ("reference", "--reference", "generated"),
    ("contact", "--contact", "similar"),
    ("time_step_s", "--time-step", 0.01),
    ("friction", "--friction", 0.8),
    ("duration_s", "--duration", 10.0),
)


def commands(results: Results) -> dict[str, str]:
    """Returns the command that makes each expected file, by path.

    Of results of tracking that are there, the options are those of their conditions; of
    those of robustness, the number of seeds.
    """
    return {file.path: _command(file, results) for file in EXPECTED}


def _command(file: ResultFile, results: Results) -> str:
    found = results.found.get(file.path, {})
    if file.name == "robustness" and found:
        (figures,) = found.values()
        seeds = figures.number("seeds")
        return file.command if seeds is None else f"{file.command} --seeds {seeds:.0f}"
    if not file.name.startswith("tracking-") or not found:
        return file.command
    (figures,) = found.values()
    options = [file.robots[0]]
    for key, option, default in _OPTIONS:
        text = isinstance(default, str)
        value = figures.text(key) if text else figures.number(key)
        if value not in (None, "", default):
            options.append(f"{option} {value if text else f'{value:g}'}")
    counts = [part.number("episodes") or 0.0 for _, part in figures.parts("labels")]
    seeds = max(counts, default=0.0)
    options += filter(None, (file.flags, f"--seeds {seeds:.0f}" if seeds else ""))
    return " ".join((_TRACKING, *options))
