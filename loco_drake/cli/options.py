"""The vocabulary of options: what several commands share, and how help tells of it.

One name means one thing in all commands: its value is of one kind, and its help begins
with the same words, up to the first full stop, colon or semicolon. What follows these
is the command's own.
"""

from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import tyro

from loco_drake.models.shipped import shipped_policies
from loco_drake.motion.gaits import GAITS, LABELS

if TYPE_CHECKING:
    from loco_drake.engine.executor import Executor


class Output(Enum):
    """Marks options that name an output, which is checked before the work."""

    FILE = auto()
    FOLDER = auto()


def outputs(command: type) -> dict[str, Output]:
    """Returns which fields of a command name an output."""
    hints = get_type_hints(command, include_extras=True)
    return {
        name: mark
        for name, hint in hints.items()
        for mark in getattr(hint, "__metadata__", ())
        if isinstance(mark, Output)
    }


def option(
    text: str | None = None,
    *,
    metavar: str | None = None,
    default: str | None = None,
    name: str | None = None,
) -> Any:
    """Returns what --help says of an option.

    Args:
        text: the help; None for the comment above the field.
        metavar: what stands for the value; None for its type.
        default: what stands for the default; None for itself, or "none".
        name: of the option; None for that of the field.
    """

    def hint(value: str) -> str:
        itself = "none" if value in ("", "None") else value
        return f"(default: {default or itself})"

    return tyro.conf.arg(name=name, help=text, metavar=metavar, help_behavior_hint=hint)


LABEL_CHOICES = ", ".join(map(str, LABELS))
GAIT_CHOICES = ", ".join(GAITS)
SCHEDULE = (
    f"Gait: {LABEL_CHOICES}; or several with their start times in s, such as "
    "dog-pace,dog-trot@3,dog-gallop@6"
)
SHIPPED = ", ".join(shipped_policies())
_VARIANTS = ", ".join(
    dict.fromkeys(name.partition("_")[2] for name in shipped_policies() if "_" in name)
)


def some_labels(default: str) -> Any:
    """Returns what --help says of --labels."""
    text = f"Gait labels: any of {LABEL_CHOICES}."
    return option(text, metavar="LABEL ...", default=default)


TrainedLabels = Annotated[
    tuple[str, ...], some_labels("those that the policy was trained on")
]
Robot = Annotated[
    str,
    option(
        "Robot: go2, a1, or a YAML file, see docs/own_robot.md.", metavar="ROBOT|FILE"
    ),
]
Workers = Annotated[int, option("Number of worker processes.")]
Json = Annotated[
    Path | None,
    option("JSON file to write: the figures.", metavar="FILE"),
    Output.FILE,
]
UnusedSeed = Annotated[
    int,
    option("Seed: accepted by every command; this one uses no random numbers."),
]
DataDir = Annotated[
    Path | None,
    option(
        "Folder of the recordings.",
        metavar="DIR",
        default="$LOCO_DRAKE_DATA, else the user's cache folder",
    ),
]
Policy = Annotated[
    Path | None,
    option(
        "Policy: a file of weights, or the name of a shipped variant of the robot's, "
        f"{_VARIANTS}.",
        metavar="POLICY|FILE",
        default="the robot's main policy",
    ),
]
Weights = Annotated[
    Path | None,
    option(
        "Folder of a run or of runs, whose tokenizer, generator and policy to take.",
        metavar="DIR",
        default="the shipped ones",
    ),
]
Tokenizer = Annotated[
    Path | None,
    option(
        "Weights from `train tokenizer`.", metavar="FILE", default="the shipped ones"
    ),
]
Generator = Annotated[
    Path | None,
    option(
        "Weights from `train generator`.", metavar="FILE", default="the shipped ones"
    ),
]
# The help of these is the comment above the field.
OutFolder = Annotated[Path, option(metavar="DIR"), Output.FOLDER]
Figures = Annotated[Path | None, option(metavar="DIR"), Output.FOLDER]
Motions = Annotated[Path, option(metavar="DIR", name="motions")]
MotionFolders = Annotated[tuple[Path, ...], option(metavar="DIR ...")]
Port = Annotated[
    int | None,
    option("Meshcat's port.", default="a free one, also if the port is in use"),
]
Html = Annotated[
    Path | None, option("HTML page to write: a replay.", metavar="FILE"), Output.FILE
]
Video = Annotated[
    Path | None,
    option("Video to write: *.mp4, *.webp or *.gif.", metavar="FILE"),
    Output.FILE,
]
Start = Annotated[
    int | None,
    option(
        "First frame, counted from 0 at the file's rate.",
        default="the first usable one",
    ),
]
End = Annotated[
    int | None, option("End frame, exclusive.", default="the end of the file")
]
Fps = Annotated[
    float | None,
    option(
        "Rate in frames/s.", default="inferred from the file's format, name or motion"
    ),
]
SOURCES = "Source of recordings: dog, horse, mpc, solo8"
Device = Annotated[
    str,
    option(
        "Where the network learns: cpu, the reference, or cuda, a GPU of NVIDIA; "
        "cuda:1 is the second. Results on a GPU differ in their last bits.",
        metavar="NAME",
    ),
]


@dataclass(kw_only=True)
class EngineOptions:
    """Where a command's workers run."""

    # Where the workers run: local, on this machine, or ray, on a Ray cluster, which
    # needs the extra 'ray'; see docs/machines.md.
    engine: Annotated[str, option(metavar="NAME")] = "local"
    # Address of the Ray cluster, such as auto or HOST:6379.
    ray_address: Annotated[
        str | None,
        option(
            metavar="TEXT",
            default="$RAY_ADDRESS, else a cluster of its own on this machine",
        ),
    ] = None

    def executor_of(self, workers: int) -> "Executor":
        """Returns what runs the work; raises InputError if an option is wrong."""
        from loco_drake.engine.choice import make_executor

        return make_executor(self.engine, workers, self.ray_address)


@dataclass(kw_only=True)
class WorkerOptions(EngineOptions):
    """How many workers a command has, and where they run."""

    workers: Workers = 1

    @property
    def executor(self) -> "Executor":
        """What runs the work; raises InputError if an option is wrong."""
        return self.executor_of(self.workers)
