"""How far a training is, on stderr."""

from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TextColumn


def progress_bar() -> Progress:
    """Returns a bar whose tasks have a ``note`` that is shown behind the steps.

    In a file or a pipe there is none, so that errors stand alone.
    """
    console = Console(stderr=True)
    return Progress(
        *Progress.get_default_columns(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}"),
        console=console,
        disable=not console.is_terminal,
        refresh_per_second=2,
    )
