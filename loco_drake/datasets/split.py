"""The split of recordings into training and validation sets, shared by all commands.

Recordings are split by subject, never by window: all recordings of one horse are in one
set, and so are all stretches of a file, which can overlap. The split is computed for a
whole data folder and stored in the provenance of each Motion.
"""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from loco_drake.datasets.segments import Segment
from loco_drake.motion.gaits import LABELS, GaitLabel

TRAIN, VALIDATION = "train", "validation"

# Share of the seconds of each label that validation is to have. The paper's is 40 % of
# its trajectories (Section IV).
SHARE = 0.3


class Split:
    """The split of a data folder.

    Subjects are animals, or recordings if the animal is unknown. Those of the
    validation set bring its shares of the fifteen labels nearest to :data:`SHARE` in
    the sum of squares: subjects in random order change sides as long as that reduces
    it. Each label keeps at least one subject in training.

    Args:
        segments: all of the data folder; those of other labels follow their subject.
        seed: seed of the order.
    """

    def __init__(self, segments: Iterable[Segment], seed: int = 0) -> None:
        seconds: dict[GaitLabel, dict[str, float]] = defaultdict(
            lambda: defaultdict(float)
        )
        for segment in segments:
            label = GaitLabel(segment.source, segment.gait)
            if label in LABELS:
                seconds[label][segment.subject] += segment.seconds
        subjects = sorted({name for of_label in seconds.values() for name in of_label})
        random = np.random.default_rng(seed)
        held: set[str] = set()
        cost = _cost(seconds, held)
        changed = True
        while changed:
            changed = False
            for subject in random.permutation(subjects):
                other = held ^ {str(subject)}
                if (other_cost := _cost(seconds, other)) < cost - 1e-12:
                    held, cost, changed = other, other_cost, True
        self._validation = frozenset(held)

    def side(self, segment: Segment) -> str:
        """Returns TRAIN or VALIDATION; unknown subjects are in training."""
        return VALIDATION if segment.subject in self._validation else TRAIN


def _cost(seconds: dict[GaitLabel, dict[str, float]], held: set[str]) -> float:
    """Returns how far the shares are off, infinity if a label has none to train on."""
    cost = 0.0
    for of_label in seconds.values():
        share = sum(of_label.get(name, 0.0) for name in held) / sum(of_label.values())
        if held >= set(of_label):
            return float("inf")
        cost += (share - SHARE) ** 2
    return cost
