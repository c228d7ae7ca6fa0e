"""How to train a network; apart from the training, which takes seconds to import."""

import math
from dataclasses import dataclass
from pathlib import Path

from loco_drake.common.errors import InputError, check_at_least


@dataclass
class LoopSettings:
    """How to run :func:`train`."""

    out: Path
    """Folder for the weights, the checkpoint and TensorBoard logs."""
    steps: int
    """Optimizer steps in all, those before a resume included."""
    learning_rate: float
    """Highest learning rate: it rises over the first 2 % of the steps, then falls to
    zero as half a cosine."""
    weight_decay: float = 0.01
    """Of AdamW."""
    seed: int = 0
    """Of the weights and the batches."""
    resume: bool = False
    """Go on from the checkpoint in --out, with the options of that run; --steps may be
    more."""
    checkpoint_every: int = 500
    """Steps between checkpoints."""
    log_every: int = 20
    """Steps between entries in the logs."""

    def check(self) -> None:
        """Raises InputError unless every setting can be used."""
        for name in ("steps", "checkpoint_every", "log_every"):
            check_at_least(name, getattr(self, name), 1)
        if not (math.isfinite(self.learning_rate) and self.learning_rate > 0):
            raise InputError(
                f"--learning-rate must be above 0, not {self.learning_rate:g}."
            )
        if not 0 <= self.weight_decay < math.inf:
            raise InputError(
                f"--weight-decay must be 0 or more, not {self.weight_decay:g}."
            )
