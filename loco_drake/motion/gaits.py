"""Gait labels, the source of a motion and its gait, and schedules of them."""

from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, nan

import numpy as np
from numpy.typing import ArrayLike

from loco_drake.common.arrays import Integers
from loco_drake.common.errors import InputError, check_choice, check_name

# Sources and gaits with an input of their own in the shipped networks. Others are valid
# too but share OTHER, so these tuples never change.
SOURCES = ("dog", "horse", "mpc", "solo8")
GAITS = ("pace", "trot", "gallop", "walk", "bound", "crawl", "stilt", "wave")
OTHER = "other"
# What an order for a gait may be instead of a label: the command chooses one, see
# control.gait_choice. The index of it is in the place of one into LABELS.
ANY = "any"
ANY_INDEX = -1
_SYNTAX = "such as dog-pace,dog-trot@3,dog-gallop@6"


@dataclass(frozen=True, order=True)
class GaitLabel:
    """A (source, gait) pair, written ``source-gait``, such as ``dog-trot``.

    Raises:
        InputError: if either is no name, see :func:`.errors.check_name`.
    """

    source: str
    gait: str

    def __post_init__(self) -> None:
        check_name("source", self.source)
        check_name("gait", self.gait)

    def __str__(self) -> str:
        return f"{self.source}-{self.gait}"

    @property
    def index(self) -> int:
        """Row of :data:`ONE_HOT`, which networks and plans store."""
        source = self.source if self.source in SOURCES else OTHER
        gait = self.gait if self.gait in GAITS else OTHER
        return ROW_LABELS.index(GaitLabel(source, gait))


# The fifteen of the paper, Section IV.
LABELS = tuple(
    GaitLabel(source, gait)
    for source, gaits in (
        ("dog", ("pace", "trot", "gallop")),
        ("horse", ("walk", "trot")),
        ("mpc", ("trot", "bound", "gallop", "crawl")),
        ("solo8", ("trot", "bound", "walk", "crawl", "stilt", "wave")),
    )
    for gait in gaits
)

# Labels of the rows of ONE_HOT: the fifteen, then all other pairs.
ROW_LABELS = LABELS + tuple(
    label
    for source in (*SOURCES, OTHER)
    for gait in (*GAITS, OTHER)
    if (label := GaitLabel(source, gait)) not in LABELS
)

# One-hot of the source, then one-hot of the gait; OTHER is zero in all columns.
ONE_HOT = np.array(
    [
        [float(label.source == source) for source in SOURCES]
        + [float(label.gait == gait) for gait in GAITS]
        for label in ROW_LABELS
    ]
)
ONE_HOT.setflags(write=False)
ONE_HOT_SIZE = ONE_HOT.shape[1]


def any_label(text: str) -> GaitLabel:
    """Returns the label written as ``text``, for any source and gait.

    Raises:
        InputError: if it is not two names with a hyphen between.
    """
    source, _, gait = text.partition("-")
    return GaitLabel(source, gait)


def parse_label(text: str) -> GaitLabel:
    """Returns the label written as ``text``.

    Raises:
        InputError: if it is not one of the fifteen labels.
    """
    names = [str(label) for label in LABELS]
    return LABELS[names.index(check_choice("gait", text, names))]


# Texts of the orders for a gait.
GAIT_CHOICES = (ANY, *map(str, LABELS))


def gait_index(text: str) -> int:
    """Returns the index into LABELS of a label, or ANY_INDEX of ANY.

    Raises:
        InputError: if ``text`` is neither.
    """
    check_choice("gait", text, GAIT_CHOICES)
    return ANY_INDEX if text == ANY else GAIT_CHOICES.index(text) - 1


def gait_name(index: int) -> str:
    """Returns the text of which :func:`gait_index` makes ``index``."""
    return ANY if index == ANY_INDEX else str(LABELS[index])


@dataclass(frozen=True)
class GaitSchedule:
    """Consecutive gaits, written ``dog-pace,dog-trot@3,dog-gallop@6``."""

    labels: tuple[GaitLabel, ...]  # in order
    starts: tuple[float, ...] = (0.0,)  # start time of each in s, ascending from 0

    def __str__(self) -> str:
        later = zip(self.labels[1:], self.starts[1:], strict=True)
        return ",".join([str(self.labels[0]), *(f"{k}@{t:g}" for k, t in later)])

    def at(self, times: ArrayLike) -> Integers:
        """Returns the index into LABELS at each of ``times`` (N,), s."""
        place = np.searchsorted(self.starts, times, side="right") - 1
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
        try:
            starts.append(float(time))
        except ValueError:
            starts.append(nan)
        if not isfinite(starts[-1]):
            raise InputError(
                f"Each gait but the first needs the time in s at which it begins, "
                f"{_SYNTAX}, which {part!r} lacks."
            )
    for earlier, start in pairwise(starts):
        if start <= earlier:
            raise InputError(
                f"Gaits must begin one after the other, at rising times above 0 s, "
                f"{_SYNTAX}, not at {start:g} s after {earlier:g} s."
            )
    return GaitSchedule(tuple(labels), tuple(starts))
