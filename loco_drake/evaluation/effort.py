"""How much ``evaluate generation`` generates and trains."""

from dataclasses import dataclass

from loco_drake.common.errors import check_at_least


@dataclass(kw_only=True)
class Effort:
    """More takes longer and tells more."""

    count: int = 24
    """Generated trajectories of each label in a set, of 2 s."""
    generator_seeds: int = 3
    """Sets of generated trajectories."""
    minutes: int = 16
    """Motions of 60 s of each label to look for drift in; 0: none."""
    seeds: int = 5
    """Classifiers that are trained for each figure."""
    steps: int = 300
    """Optimizer steps of the transformer."""

    def check(self) -> None:
        """Raises InputError unless all can be done."""
        for name in ("count", "generator_seeds", "seeds", "steps"):
            check_at_least(name, getattr(self, name), 1)
        check_at_least("minutes", self.minutes, 0)
