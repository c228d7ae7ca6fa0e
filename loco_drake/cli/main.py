"""The entry point of ``loco-drake``."""

import sys
from importlib import import_module
from typing import Any

from rich.console import Console
from rich.table import Table

from loco_drake import __version__
from loco_drake.cli.options import Output, outputs
from loco_drake.cli.output import check_output
from loco_drake.cli.parsing import parse
from loco_drake.common.determinism import use_one_thread
from loco_drake.common.drake_log import quiet_drake
from loco_drake.common.errors import InputError, check_choice, one_line

# What each command does.
_COMMANDS = {
    "simulate": "simulate a robot that performs a gait",
    "drive": "drive a robot with keys, sliders or a gamepad",
    "play": "show Motion files in the browser or in a video",
    "generate": "generate motion and write Motion files",
    "retarget": "retarget recordings to a robot",
    "humanoid": "retarget human clips to a humanoid",
    "record": "record what a robot does with motion, to learn from",
    "data list": "list the sources of motion and their licences",
    "data fetch": "download and check the recordings",
    "data inspect": "plot one stretch of a recording",
    "data pack": "pack many Motion files in few large files",
    "robot inspect": "check a robot's file, and list what it is simulated with",
    "train tokenizer": "train the VQ-VAE that encodes motion",
    "train generator": "train the GPT that generates tokens",
    "train tracker": "train the tracking policy with PPO",
    "train recipe": "train a tracking policy from nothing, in stages",
    "train guided": "improve a tracking policy by guided policy search",
    "train student": "train a policy without privileged observations, by a teacher",
    "train classifier": "train the transformer that classifies gaits",
    "runs list": "list trainings, how far they are and what they score",
    "export": "write a policy, a plan or a robot for use without Drake",
    "evaluate retargeting": "measure retargeted motion",
    "evaluate tokenizer": "measure reconstruction by the tokenizer",
    "evaluate generation": "compare generated with recorded motion",
    "evaluate tracking": "measure how well a policy tracks",
    "evaluate steering": "measure how well a policy follows commands",
    "evaluate robustness": "measure what pushes, slopes and more a policy survives",
    "report": "write one HTML page of all results",
}
# Of most commands the module is called like them, "train_tracker".
_MODULES = {
    "data list": "data",
    "data fetch": "fetch",
    "data inspect": "data",
    "runs list": "runs",
}
_HELP = ("-h", "--help")
# Libraries that Drake needs and a bare Debian or Ubuntu lacks.
_LIBRARIES = "libx11-6 libsm6 libglib2.0-0"


def main(arguments: list[str] | None = None) -> int:
    """Runs a command and returns its exit status.

    The status is 0 on success, 1 if the work failed or was interrupted, and 2 if the
    input was invalid. A robot that falls is a success.

    Args:
        arguments: the arguments; those of the process if None.
    """
    try:
        return _run(sys.argv[1:] if arguments is None else arguments)
    except InputError as error:
        return _failed(str(error), 2)
    except ImportError as error:
        if "cannot open shared object file" not in str(error):
            raise
        library = str(error).split(":")[0]
        return _failed(
            f"This system lacks {library}; on Debian or Ubuntu, install it with: "
            f"apt-get install {_LIBRARIES}."
        )
    except OSError as error:
        # Such as a full disk or a read-only folder.
        where = f": {error.filename}" if error.filename else ""
        return _failed(one_line(f"{error.strerror or error}{where}"))
    except KeyboardInterrupt:
        return _failed("interrupted")


def _failed(reason: str, status: int = 1) -> int:
    print(f"loco-drake: {reason}", file=sys.stderr)
    return status


def _run(arguments: list[str]) -> int:
    first = arguments[0] if arguments else "--help"
    if first == "--version":
        print(__version__)
        return 0
    members = [name for name in _COMMANDS if name.startswith(f"{first} ")]
    if first in _HELP or (members and arguments[1:2] and arguments[1] in _HELP):
        _print_help(members or list(_COMMANDS))
        return 0
    words = 2 if members else 1
    if len(arguments) < words:
        raise InputError(f"Name a subcommand: {', '.join(members)}.")
    name, rest = " ".join(arguments[:words]), arguments[words:]
    check_choice("command", name, members or _COMMANDS)
    use_one_thread()
    command = command_class(name)
    quiet_drake()
    parsed: Any = parse(command, name, rest)
    for option, kind in outputs(command).items():
        check_output(getattr(parsed, option), folder=kind is Output.FOLDER)
    # A recipe's options are in its folder, not in one checkpoint.
    with_checkpoint = name.startswith("train ") and name != "train recipe"
    if with_checkpoint and getattr(parsed, "resume", False):
        from loco_drake.cli.training import parse_resumed

        parsed = parse_resumed(parsed, name, rest)
    status: int = parsed.run()
    return status


def command_class(name: str) -> Any:
    """Returns the class of a command, importing its module on demand.

    ``--help`` thus does not import torch and Drake.
    """
    module = _MODULES.get(name, name.replace(" ", "_"))
    return getattr(
        import_module(f"loco_drake.cli.{module}"), name.title().replace(" ", "")
    )


def _print_help(names: list[str]) -> None:
    console = Console()
    console.print("loco-drake: learn quadruped motion and simulate it in Drake\n")
    table = Table(box=None, show_header=False, padding=(0, 2))
    for name in names:
        table.add_row(f"loco-drake {name}", _COMMANDS[name])
    console.print(table)
    console.print("\nloco-drake COMMAND --help lists the options of a command.")
