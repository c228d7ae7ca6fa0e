"""``loco-drake train tracker``: trains the tracking policy."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from loco_drake.cli.options import (
    SHIPPED,
    Device,
    EngineOptions,
    Json,
    OutFolder,
    option,
)
from loco_drake.cli.training import train_policy
from loco_drake.common.errors import check_at_least
from loco_drake.tracking.config import TrainingConfig


@dataclass(kw_only=True)
class TrainTracker(TrainingConfig, EngineOptions):
    """Train the tracking policy on a folder of Motion files with PPO.

    Ctrl-C stops the training; --resume continues from the last update.
    """

    NAME: ClassVar[str] = "tracker"
    # Folder of Motion files: those to track, such as `generate` writes. Required
    # without --resume.
    references: Annotated[Path | None, option(metavar="DIR", name="motions")] = None
    # Folder to write to: the checkpoint, policy and TensorBoard logs.
    out: OutFolder = Path("runs/tracker")
    # Randomize the world of each episode: friction, masses, motors, latency, pushes and
    # sensor noise. Parts without a range of their own use the standard range.
    randomize: bool = False
    device: Device = "cpu"
    start_from: Annotated[
        Path | None,
        option(
            f"Networks to start from: a shipped policy, {SHIPPED}; or the "
            "policy.safetensors or checkpoint.safetensors of a run; of any robot.",
            metavar="POLICY|FILE",
        ),
    ] = None
    # Continue what is in --out: from its checkpoint, with the options of that run, of
    # which only --steps may increase.
    resume: bool = False
    json: Json = None

    def run(self) -> int:
        """Trains, prints and writes; returns the exit status."""
        from loco_drake.common.device import find_device
        from loco_drake.common.run_folder import check_folder, options_of
        from loco_drake.models.shipped import training_path
        from loco_drake.tracking.train import POLICY, train_tracker

        check_at_least("steps", self.steps, 1)
        environment = self.environment
        if self.randomize:
            environment.randomization = environment.randomization.with_standard()
        self.check()
        find_device(self.device)
        executor = self.executor_of(self.workers)
        check_folder(self.out, POLICY, self.resume)
        start = self.start_from and training_path(self.start_from)
        return train_policy(
            self,
            lambda plans, report: train_tracker(
                plans,
                self,
                self.out,
                resume=self.resume,
                first=start,
                options=options_of(self),
                report=report,
                executor=executor,
                device=self.device,
            ),
        )
