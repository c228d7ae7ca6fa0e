"""The learning curve in a training log."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake.common.errors import InputError, one_line
from loco_drake.common.files import atomic_path, parse_json

PROGRESS = "progress.jsonl"
POINTS = 200
_MAX_BYTES = 256 * 2**20  # of a log; a line has about 1 KB
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
    lines = [line for _, line in _sound(_lines(log))]
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


def trim_log(log: Path, steps: int, batch: int) -> None:
    """Removes the entries of a log after ``steps``, which a lost run wrote.

    Damaged lines are removed, too. They, and missing lines at the end, are reported on
    stderr. A run that ends writes no line for its last batch.

    Args:
        log: may be missing.
        steps: of the checkpoint.
        batch: steps from one line to the next.

    Raises:
        InputError: if the log is no file, or too large.
    """
    lines = _lines(log) if log.exists() else []
    sound = list(_sound(lines))
    kept = [(text, row) for text, row in sound if row["steps"] <= steps]
    last = int(kept[-1][1]["steps"]) if kept else 0
    remarks = []
    if len(sound) < len(lines):
        remarks.append(f"{len(lines) - len(sound)} damaged lines were removed")
    if last < steps - batch:
        remarks.append(f"it ends at step {last}, but the checkpoint at step {steps}")
    if remarks:
        print(one_line(f"{log}: {'; '.join(remarks)}."), file=sys.stderr)
    if lines:
        with atomic_path(log) as temporary:
            temporary.write_text("".join(text + "\n" for text, _ in kept))


def _lines(log: Path) -> list[str]:
    """Returns the lines of a log.

    Raises:
        InputError: if it is no file, or too large.
    """
    if not log.is_file():
        raise InputError(f"{log} is not a file.")
    if log.stat().st_size > _MAX_BYTES:
        raise InputError(f"{log} is larger than {_MAX_BYTES >> 20} MB.")
    return log.read_text(errors="replace").splitlines()


def _sound(lines: Iterable[str]) -> Iterator[tuple[str, dict[str, float]]]:
    """Yields each line with its figures; skips those that are damaged or late."""
    before = 0.0
    for text in lines:
        with suppress(ValueError, OverflowError):
            row = parse_json(text)
            if any(type(value) not in (int, float) for value in row.values()):
                continue
            figures = {name: float(value) for name, value in row.items()}
            steps = figures.get("steps", 0.0)
            if steps > before and steps.is_integer() and "seconds" in figures:
                before = steps
                yield text, figures
