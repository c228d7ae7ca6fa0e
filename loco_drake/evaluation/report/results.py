"""Results on disk, written by the ``evaluate`` commands, by robot.

Everything that is read is checked; unexpected content is reported as damage in one
sentence.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from loco_drake.common.errors import InputError
from loco_drake.common.files import figures_sha256, read_json
from loco_drake.evaluation.report.content import CONTENT
from loco_drake.evaluation.report.figures import Figures
from loco_drake.models.robots import ROBOTS
from loco_drake.models.shipped import pretrained_dir


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
    ("simulator", "--simulator", "drake"),
    ("contact", "--contact", "similar"),
    ("time_step_s", "--time-step", 0.01),
    ("friction", "--friction", 0.8),
    ("duration_s", "--duration", 10.0),
)
_OF_MUJOCO = {"contact": "elliptic", "time_step_s": 0.002}  # needs no option either


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
    mujoco = figures.text("simulator") == "mujoco"
    for key, option, usual in _OPTIONS:
        default = _OF_MUJOCO.get(key, usual) if mujoco else usual
        text = isinstance(default, str)
        value = figures.text(key) if text else figures.number(key)
        if value not in (None, "", default):
            options.append(f"{option} {value if text else f'{value:g}'}")
    counts = [part.number("episodes") or 0.0 for _, part in figures.parts("labels")]
    seeds = max(counts, default=0.0)
    options += filter(None, (file.flags, f"--seeds {seeds:.0f}" if seeds else ""))
    return " ".join((_TRACKING, *options))
