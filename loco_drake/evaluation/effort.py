"""Amount of data that ``evaluate generation`` generates and trains on."""

from dataclasses import dataclass

from loco_drake.common.errors import check_at_least


@dataclass(kw_only=True)
class Effort:
    """Sample sizes of ``evaluate generation``."""

    # Generated trajectories of 2 s per label and set.
    count: int = 24
    # Number of sets of generated trajectories.
    generator_seeds: int = 3
    # Motions of 60 s per label for measuring drift; 0 to skip it.
    minutes: int = 16
    # Classifiers to train for each figure.
    seeds: int = 5
    # Optimizer steps of the transformer.
    steps: int = 300

    def check(self) -> None:
        """Raises InputError unless all can be done."""
        for name in ("count", "generator_seeds", "seeds", "steps"):
            check_at_least(name, getattr(self, name), 1)
        check_at_least("minutes", self.minutes, 0)
