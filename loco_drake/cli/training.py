"""What the ``train`` commands of the networks share."""

from math import isfinite

from rich.console import Console

from loco_drake.common.errors import InputError, check_at_least


def check_steps(steps: int, learning_rate: float) -> None:
    """Raises InputError unless the options of a training can be used."""
    check_at_least("steps", steps, 1)
    if not (isfinite(learning_rate) and learning_rate > 0):
        raise InputError(f"--learning-rate must be above 0, not {learning_rate:g}.")


def print_stopped(done: int, steps: int) -> int:
    """Says on stderr how to go on; returns the exit status of unfinished work."""
    Console(stderr=True, highlight=False).print(
        f"Stopped after {done} of {steps} steps; "
        "the same command with --resume goes on."
    )
    return 1
