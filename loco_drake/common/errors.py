"""The error that a user can cause and mend."""

from collections.abc import Iterable


class InputError(ValueError):
    """Bad input: the message is one sentence that names the valid choices.

    The command line prints it without a traceback and exits with status 2.
    """


def check_choice(what: str, value: str, choices: Iterable[str]) -> str:
    """Returns ``value`` if it is one of ``choices``.

    Raises:
        InputError: naming ``what`` was wrong and every valid choice.
    """
    choices = list(choices)
    if value not in choices:
        raise InputError(
            f"Unknown {what} {value!r}; the choices are {', '.join(choices)}."
        )
    return value


def check_at_least(option: str, value: int, least: int) -> None:
    """Raises InputError if ``value`` is below ``least``."""
    if value < least:
        name = option.replace("_", "-")
        raise InputError(f"--{name} must be {least} or more, not {value}.")
