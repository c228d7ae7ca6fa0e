"""The learning curve in a training log."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake.common.files import atomic_path, parse_json

PROGRESS = "progress.jsonl"
POINTS = 200
_PREFIX = "return/"


def learning_curve(log: Path, points: int = POINTS) -> dict[str, Any]:
    """Returns the learning curve of a training log, thinned to ``points`` lines.

    The log ``progress.jsonl`` has a line for each batch; the first and the last one are
    kept. Resumed runs append to the same log; their seconds are summed.

    Returns:
        "steps" of the environment and "seconds" of training so far, and under "return"
        for each label its mean normalized return (0-100) in recent episodes of the
        training, None before the label was trained on. All are equally long.
    """
    lines = [line for _, line in _sound_lines(log)]
    seconds, before = [], 0.0
    for earlier, line in zip([None, *lines], lines, strict=False):
        if earlier is not None and line["seconds"] < earlier["seconds"]:
            before += earlier["seconds"]
        seconds.append(before + line["seconds"])
    ends = np.linspace(0, len(lines) - 1, points if lines else 0)
    kept = np.unique(ends.round().astype(int))
    labels = {
        name.removeprefix(_PREFIX): None
        for line in lines
        for name in line
        if name.startswith(_PREFIX) and "-" in name
    }
    return {
        "steps": [int(lines[i]["steps"]) for i in kept],
        "seconds": [round(seconds[i], 1) for i in kept],
        "return": {
            label: [
                None if score is None else round(score, 2)
                for score in (lines[i].get(_PREFIX + label) for i in kept)
            ]
            for label in labels
        },
    }


def trim_log(log: Path, steps: int) -> None:
    """Removes the entries of a log after ``steps``, which a lost run wrote."""
    if not log.exists():
        return
    kept = [text + "\n" for text, row in _sound_lines(log) if row["steps"] <= steps]
    with atomic_path(log) as temporary:
        temporary.write_text("".join(kept))


def _sound_lines(log: Path) -> Iterator[tuple[str, dict[str, float]]]:
    """Yields each line with its figures; skips incomplete and damaged lines."""
    for text in log.read_text(errors="replace").splitlines():
        with suppress(ValueError, TypeError, OverflowError):
            row = {name: float(value) for name, value in parse_json(text).items()}
            if row.keys() >= {"steps", "seconds"}:
                yield text, row
