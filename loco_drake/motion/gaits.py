"""The gait labels: where a motion comes from and how its feet fall."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import check_choice

SOURCES = ("dog", "horse", "mpc", "solo8")
GAITS = ("pace", "trot", "gallop", "walk", "bound", "crawl", "stilt", "wave")


@dataclass(frozen=True, order=True)
class GaitLabel:
    """A (source, gait) pair, written ``source-gait``, such as ``dog-trot``."""

    source: str
    gait: str

    def __str__(self) -> str:
        return f"{self.source}-{self.gait}"

    @property
    def index(self) -> int:
        """Position in :data:`LABELS`; what networks and plans store."""
        return LABELS.index(self)


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

ONE_HOT_SIZE = len(SOURCES) + len(GAITS)


def parse_label(text: str) -> GaitLabel:
    """Returns the label written as ``text``.

    Raises:
        InputError: if it is not one of the fifteen labels.
    """
    names = [str(label) for label in LABELS]
    return LABELS[names.index(check_choice("gait", text, names))]


def _one_hot_table() -> NDArray[np.float64]:
    table = np.zeros((len(LABELS), ONE_HOT_SIZE))
    for row, label in zip(table, LABELS, strict=True):
        row[SOURCES.index(label.source)] = 1.0
        row[len(SOURCES) + GAITS.index(label.gait)] = 1.0
    table.setflags(write=False)
    return table


# Rows in the order of LABELS: one-hot of the source, then one-hot of the gait.
ONE_HOT = _one_hot_table()
