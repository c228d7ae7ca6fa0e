"""Steps that the ``train`` commands share."""

from collections.abc import Sequence
from typing import Any

import tyro
from rich.console import Console

from loco_drake.common.errors import InputError

# Options that are not the run's: where it is, and what a call does.
_OF_THE_CALL = ("out", "resume", "json", "start_from")
# Where it learned from may be elsewhere now: what is there is compared.
_FOLDERS = ("motions", "references", "tokenizer")


def parse_resumed(command: Any, prog: str, args: Sequence[str]) -> Any:
    """Returns a command that resumes; options that are not given are those of the run.

    Args:
        command: as parsed with the defaults of its class.
        prog: its name.
        args: its arguments.

    Raises:
        InputError: if there is no sound checkpoint of such a training, or an option
            contradicts it.
    """
    from loco_drake.common.run_folder import (
        CHECKPOINT,
        check_folder,
        check_same,
        options_of,
        read_checkpoint,
        settings,
        sound,
        with_options,
    )

    if getattr(command, "start_from", None) is not None:
        raise InputError("Give either --start-from or --resume, not both.")
    check_folder(command.out, CHECKPOINT, resume=True)
    saved = read_checkpoint(command.out / CHECKPOINT, command.NAME)
    own = {k: v for k, v in saved.options.items() if k not in _OF_THE_CALL}
    with sound(saved.path):
        default = with_options(command, own)
    parsed = tyro.cli(type(command), prog=prog, args=args, default=default)
    options = settings(options_of(parsed), *_OF_THE_CALL, *_FOLDERS)
    check_same(saved, options, options, parsed.steps)
    return parsed


def print_stopped(done: int, steps: int) -> int:
    """Prints how to resume on stderr; returns the exit status of unfinished work."""
    how = "the same command with --resume goes on" if done else "nothing is saved yet"
    Console(stderr=True, highlight=False).print(
        f"Stopped after {done} of {steps} steps; {how}."
    )
    return 1
