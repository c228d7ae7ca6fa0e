"""Settings of network training, separate from the training, which imports slowly."""

from dataclasses import dataclass
from pathlib import Path

from loco_drake.common.errors import check_at_least, check_bounds

# Those that the result depends on, besides the steps.
RUN_SETTINGS = ("learning_rate", "weight_decay", "seed")


@dataclass
class LoopSettings:
    """Settings of :func:`loco_drake.generation.training.train`."""

    # Folder for the weights, the checkpoint and TensorBoard logs.
    out: Path
    # Number of training steps: the optimizer's, including those before --resume.
    steps: int
    # Learning rate: its peak. It warms up over the first 2 % of the steps, then decays
    # to 0 as a half cosine.
    learning_rate: float
    # Weight decay of AdamW.
    weight_decay: float = 0.01
    # Seed: of the initial weights and the batches.
    seed: int = 0
    # Where the network learns, see common.device.
    device: str = "cpu"
    # Continue what is in --out: from its checkpoint, with the options of that run, of
    # which only --steps may increase.
    resume: bool = False
    # Optimizer steps between checkpoints.
    checkpoint_every: int = 500
    # Optimizer steps between log entries.
    log_every: int = 20

    def check(self) -> None:
        """Raises InputError unless every setting can be used."""
        for name in ("steps", "checkpoint_every", "log_every"):
            check_at_least(name, getattr(self, name), 1)
        check_bounds("--learning-rate", self.learning_rate, 0, above=True)
        check_bounds("--weight-decay", self.weight_decay, 0)
