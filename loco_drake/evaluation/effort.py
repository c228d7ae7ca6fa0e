"""Amount of data that ``evaluate generation`` generates and trains on."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from loco_drake.common.errors import check_at_least


@dataclass(kw_only=True)
class Effort:
    """Sample sizes of ``evaluate generation``."""

    # Number of trajectories of 2 s for each of the fifteen labels; generated, in each
    # set.
    count: Annotated[int, tyro.conf.arg(name="trajectories")] = 24
    # Number of sets of generated trajectories.
    generator_seeds: int = 3
    # Motions of 60 s per label for measuring drift; 0 to skip it.
    minutes: int = 16
    # Number of seeds, counted up from --seed: each gives a classifier for each figure.
    seeds: int = 5
    # Number of training steps: of the transformer that classifies.
    steps: int = 300

    def check(self) -> None:
        """Raises InputError unless all can be done."""
        check_at_least("trajectories", self.count, 1)
        for name in ("generator_seeds", "seeds", "steps"):
            check_at_least(name, getattr(self, name), 1)
        check_at_least("minutes", self.minutes, 0)
