"""Whether what weights are judged by was part of their training."""

from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

from loco_drake.evaluation.recorded import Recorded
from loco_drake.generation.training_record import (
    read_training_record,
    seen_in_training,
)


def trained_on(
    paths: Mapping[str, Path], recorded: Recorded, robot: str
) -> dict[str, list[str] | None]:
    """Returns which recordings of validation weights were trained on; warns of them.

    Args:
        paths: weights by kind, "tokenizer" or "generator".
        recorded: retargeted recordings.
        robot: named in the warning.

    Returns:
        Names of subjects by kind; None where the weights do not say.
    """
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    result = {}
    for kind, path in paths.items():
        record = read_training_record(path, kind)
        seen = seen_in_training(record, recorded.validation)
        if seen is None:
            text = f"What the {kind} was trained on is not recorded in {path}."
            console.print(f"{robot}: {text}", markup=False)
        elif seen:
            text = f"The {kind} was trained on recordings of validation: "
            console.print(f"{robot}: Warning: {text}{', '.join(seen)}.", markup=False)
        result[kind] = seen
    return result
