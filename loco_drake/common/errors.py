"""Errors in user input, and checks that raise them."""

import re
from collections.abc import Iterable
from math import inf, isfinite
from numbers import Real
from typing import Any

_LONGEST_WORD = 300  # such as a long path
_LONGEST_NAME = 64


class InputError(ValueError):
    """Invalid input; the message is one sentence that names the valid choices.

    The command line prints it without a traceback and exits with status 2. The message
    is always one line of printable text, see :func:`one_line`.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def one_line(text: str) -> str:
    """Returns ``text`` with control characters escaped and very long words cut."""
    line = "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in text
    )
    endless = rf"\S{{{_LONGEST_WORD},}}"
    return re.sub(endless, lambda word: f"{word[0][:99]}...{word[0][-99:]}", line)


def quoted(value: object) -> str:
    """Returns user input as messages quote it: escaped, at most 64 characters.

    Use it for everything from a file or the command line except paths.
    """
    text = str(value)
    cut = text if len(text) <= _LONGEST_NAME else f"{text[: _LONGEST_NAME - 3]}..."
    return repr(cut)


def check_name(what: str, value: str) -> str:
    """Returns ``value`` if it is valid as a name in files, messages and file names.

    Raises:
        InputError: unless it has 1 to 64 printable characters, and no "/".
    """
    if not (0 < len(value) <= _LONGEST_NAME and value.isprintable()) or "/" in value:
        raise InputError(
            f"A {what} must have 1 to {_LONGEST_NAME} printable characters and no "
            f"slash, not be {quoted(value)}."
        )
    return value


def check_choice(what: str, value: str, choices: Iterable[str]) -> str:
    """Returns ``value`` if it is one of ``choices``.

    Raises:
        InputError: naming ``what`` and every valid choice.
    """
    choices = list(choices)
    if value not in choices:
        raise InputError(
            f"Unknown {what} {quoted(value)}; the choices are {', '.join(choices)}."
        )
    return value


def check_at_least(option: str, value: int, least: int) -> None:
    """Raises InputError if the value of a command's option is below ``least``."""
    check_bounds(f"--{option.replace('_', '-')}", value, least)


def check_bounds(
    what: str, value: float, low: float, high: float = inf, *, above: bool = False
) -> None:
    """Raises InputError unless ``value`` is finite and from ``low`` to ``high``.

    Its name ``what`` begins the sentence; ``above`` excludes ``low`` itself.
    """
    enough = value > low if above else value >= low
    if not (enough and value <= high and value != inf):
        least = f"above {low:g}" if above else f"{low:g} or more"
        most = "" if high == inf else f" and at most {high:g}"
        raise InputError(f"{what} must be {least}{most}, not {value}.")


def check_number(what: str, value: Any, low: float, high: float = inf) -> None:
    """Raises InputError unless ``value`` is a finite number from ``low`` to ``high``.

    In contrast to :func:`check_bounds` it may be of any type.
    """
    number = isinstance(value, Real) and not isinstance(value, bool)
    try:
        valid = number and isfinite(value) and low <= value <= high
        given = value if number else quoted(value)
    except OverflowError:
        valid, given = False, "an integer beyond 1e308"
    if not valid:
        bounds = f"of at least {low:g}" if high == inf else f"from {low:g} to {high:g}"
        raise InputError(f"{what} must be a number {bounds}, not {given}.")
