"""Gait labels: the source of a motion and its gait."""

from dataclasses import dataclass

import numpy as np

from loco_drake.common.errors import check_choice, check_name

# Sources and gaits with an input of their own in the shipped networks. Others are valid
# too but share OTHER, so these tuples never change.
SOURCES = ("dog", "horse", "mpc", "solo8")
GAITS = ("pace", "trot", "gallop", "walk", "bound", "crawl", "stilt", "wave")
OTHER = "other"


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
