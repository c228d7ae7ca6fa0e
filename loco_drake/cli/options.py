"""Options that several commands have."""

from pathlib import Path
from typing import Annotated, Any

import tyro


def option(
    text: str | None = None, *, metavar: str | None = None, default: str | None = None
) -> Any:
    """Returns what --help says of an option.

    Args:
        text: the help; None for the comment above the field.
        metavar: what stands for the value; None for its type.
        default: what stands for the default; None for itself.
    """
    hint = default and f"(default: {default})"
    return tyro.conf.arg(help=text, metavar=metavar, help_behavior_hint=hint)


Json = Annotated[Path | None, option("Write the figures to this JSON file.")]
UnusedSeed = Annotated[
    int, option("Accepted by every command; this one uses no random numbers.")
]
DataDir = Annotated[
    Path | None,
    option(
        "Folder of the recordings.",
        default="$LOCO_DRAKE_DATA, else the user's cache folder",
    ),
]
Policy = Annotated[
    Path | None,
    option(
        "Weights of the policy, or the name of a shipped variant, such as randomized.",
        default="the robot's main policy",
    ),
]
Weights = Annotated[
    Path | None,
    option(
        "Folder of a run or of runs, whose tokenizer, generator and policy to take.",
        default="the shipped ones",
    ),
]
Tokenizer = Annotated[
    Path | None, option("Weights from `train tokenizer`.", default="the shipped ones")
]
Generator = Annotated[
    Path | None, option("Weights from `train generator`.", default="the shipped ones")
]
