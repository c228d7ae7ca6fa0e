"""The entry point of ``loco-drake``."""

import logging
import sys
from importlib import import_module
from typing import Any

import tyro
from rich.console import Console
from rich.table import Table

from loco_drake import __version__
from loco_drake.common.determinism import use_one_thread
from loco_drake.common.errors import InputError, check_choice, one_line
from loco_drake.common.files import check_writable

# Command: module, class, what it does. A module is imported only when its command is
# asked for: --help should not wait for torch and Drake.
_COMMANDS = {
    "simulate": ("simulate", "Simulate", "a robot does a gait, in physics"),
    "generate": ("generate", "Generate", "write Motion files for a gait"),
    "retarget": ("retarget", "Retarget", "recordings to Motion files of a robot"),
    "data list": ("data", "DataList", "the sources of motion and their licences"),
    "data fetch": ("fetch", "DataFetch", "download the recordings, checked"),
    "data inspect": ("data", "DataInspect", "one stretch of a recording as a picture"),
    "train tokenizer": ("train_tokenizer", "TrainTokenizer", "motion to tokens"),
    "train generator": (
        "train_generator",
        "TrainGenerator",
        "the GPT that writes them",
    ),
    "train tracker": ("train_tracker", "TrainTracker", "the policy, by PPO"),
    "train classifier": (
        "train_classifier",
        "TrainClassifier",
        "what tells gaits apart, to judge generated motion",
    ),
    "export": ("export", "Export", "the policy as ONNX"),
    "evaluate retargeting": (
        "evaluate_retargeting",
        "EvaluateRetargeting",
        "how well recordings become motion of a robot",
    ),
    "evaluate tokenizer": (
        "evaluate_tokenizer",
        "EvaluateTokenizer",
        "how well motion survives the way to tokens and back",
    ),
    "evaluate generation": (
        "evaluate_generation",
        "EvaluateGeneration",
        "how generated motion compares with recorded motion",
    ),
    "evaluate tracking": (
        "evaluate_tracking",
        "EvaluateTracking",
        "how well the policy follows its references",
    ),
    "report": ("report", "Report", "one page of all results, beside the paper's"),
}
_HELP = ("-h", "--help")
# Options that name what is written; it is found out before the work whether it can be.
_OUTPUTS = ("json", "html", "out", "figures")
_ONE_FILE = ("report", "export", "data inspect")  # whose --out is no folder
# What Drake needs of a bare Debian or Ubuntu.
_LIBRARIES = "libx11-6 libsm6 libglib2.0-0"


def main(arguments: list[str] | None = None) -> int:
    """Runs a command; returns its exit status.

    0 means done (a fall is a result), 1 that the work failed or was interrupted, 2
    that the input was wrong, which one sentence on stderr explains.

    Args:
        arguments: instead of those of the process.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        if not arguments or arguments[0] in _HELP:
            _print_help(list(_COMMANDS))
            return 0
        if arguments[0] == "--version":
            print(__version__)
            return 0
        members = [n for n in _COMMANDS if n.startswith(f"{arguments[0]} ")]
        if members and arguments[1:2] and arguments[1] in _HELP:
            _print_help(members)
            return 0
        name, rest = _split(arguments, members)
        module, class_name, _ = _COMMANDS[name]
        use_one_thread()
        command = getattr(import_module(f"loco_drake.cli.{module}"), class_name)
        # A filter, for importing Drake sets the level anew.
        logging.getLogger("drake").addFilter(_is_error)
        prog = f"loco-drake {name}"
        parsed: Any = tyro.cli(command, prog=prog, args=rest)
        for option in _OUTPUTS:
            into = option == "figures" or (option == "out" and name not in _ONE_FILE)
            check_writable(getattr(parsed, option, None), folder=into)
        if getattr(parsed, "resume", False):
            from loco_drake.cli.training import parse_resumed

            parsed = parse_resumed(parsed, prog, rest)
        status: int = parsed.run()
        return status
    except InputError as error:
        print(f"loco-drake: {error}", file=sys.stderr)
        return 2
    except ImportError as error:
        if "cannot open shared object file" not in str(error):
            raise
        library = str(error).split(":")[0]
        print(
            f"loco-drake: This system lacks {library}; on Debian or Ubuntu, mend that "
            f"by: apt-get install {_LIBRARIES}.",
            file=sys.stderr,
        )
        return 1
    except OSError as error:
        # A full disk, a folder that may not be written to: not this program's fault.
        reason = f"{error.strerror}: {error.filename}" if error.filename else error
        print(f"loco-drake: {one_line(str(reason))}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("loco-drake: interrupted", file=sys.stderr)
        return 1


def _is_error(record: logging.LogRecord) -> bool:
    """Drake reports harmless properties of models below this level."""
    return record.levelno >= logging.ERROR


def _split(arguments: list[str], members: list[str]) -> tuple[str, list[str]]:
    """Returns the command's name and its own arguments.

    Args:
        arguments: at least one.
        members: the commands of two words whose first word comes first.
    """
    words = 2 if members else 1
    if len(arguments) < words:
        raise InputError(f"Say which: {', '.join(members)}.")
    name = " ".join(arguments[:words])
    check_choice("command", name, members or _COMMANDS)
    return name, arguments[words:]


def _print_help(names: list[str]) -> None:
    console = Console()
    console.print("loco-drake: quadruped motion, learned and simulated in Drake\n")
    table = Table(box=None, show_header=False, padding=(0, 2))
    for name in names:
        table.add_row(f"loco-drake {name}", _COMMANDS[name][2])
    console.print(table)
    console.print("\nEach command explains its options with --help.")
