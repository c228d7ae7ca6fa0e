"""Arguments to commands: how options are read, and their former names."""

from collections.abc import Sequence
from typing import Any

import tyro

# Former names of options, by command. They stay valid, and are in no help.
FORMER = {
    "generate": {"--pace": "--speed-rank"},
    "play": {"--source": "--keypoints", "--no-source": "--no-keypoints"},
    "retarget": {"--steer": "--steered"},
    "record": {"--references": "--motions"},
    "data fetch": {"--mirror": "--from"},
    "data inspect": {"--out": "--save"},
    "train generator": {"--tell": "--teach"},
    "train tracker": {
        "--references": "--motions",
        "--homing": "--position-penalty",
    },
    "train student": {
        "--references": "--motions",
        "--homing": "--position-penalty",
    },
    "export": {"--out": "--onnx"},
    "evaluate generation": {"--count": "--trajectories"},
    "evaluate tracking": {"--mjcf": "--mujoco-model"},
    "report": {
        "--out": "--html",
        "--replays": "--labels",
        "--replay-seconds": "--duration",
    },
}


def parse(
    command: type, name: str, arguments: Sequence[str], default: Any = None
) -> Any:
    """Returns the command that arguments ask for; exits with status 2 if it cannot.

    Args:
        command: its class.
        name: of the command, such as "train tracker".
        arguments: its options, under their present or former names.
        default: has the options that are not given; None for the class's own.
    """
    given = {} if default is None else {"default": default}
    return tyro.cli(
        command,
        prog=f"loco-drake {name}",
        args=_renamed(name, arguments),
        config=(tyro.conf.DisallowNone,),
        **given,
    )


def _renamed(name: str, arguments: Sequence[str]) -> list[str]:
    former = FORMER.get(name, {})
    renamed = []
    for argument in arguments:
        option, equals, value = argument.partition("=")
        present = former.get(option.replace("_", "-"), option)
        renamed.append(f"{present}{equals}{value}")
    return renamed
