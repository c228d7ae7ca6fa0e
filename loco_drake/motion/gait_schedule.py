"""A schedule of gaits over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import GaitLabel, parse_label

SYNTAX = "such as dog-pace,dog-trot@3,dog-gallop@6"


@dataclass(frozen=True)
class GaitSchedule:
    """Consecutive gaits, written ``dog-pace,dog-trot@3,dog-gallop@6``.

    Attributes:
        labels: the gaits in order.
        starts: start time of each gait in s, ascending from 0.
    """

    labels: tuple[GaitLabel, ...]
    starts: tuple[float, ...] = (0.0,)

    def __str__(self) -> str:
        later = zip(self.labels[1:], self.starts[1:], strict=True)
        return ",".join([str(self.labels[0]), *(f"{k}@{t:g}" for k, t in later)])

    def at(self, times: Sequence[float] | NDArray[np.float64]) -> NDArray[np.int64]:
        """Returns the index into LABELS at each of ``times`` (N,), s."""
        place = np.searchsorted(self.starts, np.asarray(times), side="right") - 1
        return np.array([label.index for label in self.labels])[place]

    def check_ends_by(self, duration: float) -> None:
        """Raises InputError if a gait starts only after ``duration`` s."""
        if self.starts[-1] >= duration:
            raise InputError(
                f"{self.labels[-1]} starts at {self.starts[-1]:g} s, but changes "
                f"of gait must come before the end, at {duration:g} s."
            )


def parse_schedule(text: str) -> GaitSchedule:
    """Returns the schedule written as ``text``: a label, or several with start times.

    Raises:
        InputError: if a label is unknown, or a time is missing, not a number, or not
            later than the one before.
    """
    first, *later = text.split(",")
    labels, starts = [parse_label(first)], [0.0]
    for part in later:
        name, _, time = part.partition("@")
        labels.append(parse_label(name))
        starts.append(_seconds(part, time))
    for earlier, start in pairwise(starts):
        if start <= earlier:
            raise InputError(
                f"Gaits must begin one after the other, at rising times above 0 s, "
                f"{SYNTAX}, not at {start:g} s after {earlier:g} s."
            )
    return GaitSchedule(tuple(labels), tuple(starts))


def _seconds(part: str, time: str) -> float:
    try:
        seconds = float(time)
    except ValueError:
        seconds = float("nan")
    if not isfinite(seconds):
        raise InputError(
            f"Each gait but the first needs the time in s at which it begins, "
            f"{SYNTAX}, which {part!r} lacks."
        )
    return seconds
