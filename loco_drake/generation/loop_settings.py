"""Settings of network training, separate from the training, which imports slowly."""

import math
from dataclasses import dataclass
from pathlib import Path

from loco_drake.common.errors import InputError, check_at_least


@dataclass
class LoopSettings:
    """Settings of :func:`loco_drake.generation.training.train`."""

    out: Path
    """Folder for the weights, the checkpoint and TensorBoard logs."""
    steps: int
    """Total optimizer steps, including those before --resume."""
    learning_rate: float
    """Peak learning rate: warms up over the first 2 % of the steps, then decays to 0 as
    a half cosine."""
    weight_decay: float = 0.01
    """Weight decay of AdamW."""
    seed: int = 0
    """Seed of the initial weights and the batches."""
    resume: bool = False
    """Continue from the checkpoint in --out with the options of that run. Only --steps
    may increase."""
    checkpoint_every: int = 500
    """Optimizer steps between checkpoints."""
    log_every: int = 20
    """Optimizer steps between log entries."""

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
