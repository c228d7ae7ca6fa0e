"""``loco-drake train guided``: improves a policy by guided policy search."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from loco_drake.cli.options import SHIPPED, EngineOptions, Json, OutFolder, option
from loco_drake.cli.training import train_policy
from loco_drake.common.errors import check_at_least
from loco_drake.tracking.guided_config import GuidedConfig


@dataclass(kw_only=True)
class TrainGuided(GuidedConfig, EngineOptions):
    """Improve a policy with what iterative LQR finds in the physics (guided search).

    The policy tracks stretches of motion, iterative LQR improves its actions there, and
    the policy learns the feedback laws that result. Ctrl-C stops the training; --resume
    continues it.
    """

    NAME: ClassVar[str] = "guided"
    # Folder of Motion files: those to track, such as `generate` writes. Required
    # without --resume.
    references: Annotated[Path | None, option(metavar="DIR", name="motions")] = None
    # Folder to write to: the checkpoint, policy and laws.
    out: OutFolder = Path("runs/guided")
    start_from: Annotated[
        Path | None,
        option(
            f"Networks to start from: a shipped policy, {SHIPPED}; or the "
            "policy.safetensors of a run.",
            metavar="POLICY|FILE",
            default="the robot's main policy",
        ),
    ] = None
    # Continue what is in --out: from its checkpoint, with the options of that run, of
    # which only --steps may increase.
    resume: bool = False
    json: Json = None

    def run(self) -> int:
        """Trains, prints and writes; returns the exit status."""
        from loco_drake.common.run_folder import check_folder, options_of
        from loco_drake.models.robots import get_simulated
        from loco_drake.models.shipped import policy_path, training_path
        from loco_drake.tracking.train import POLICY
        from loco_drake.tracking.train_guided import train_guided

        check_at_least("steps", self.steps, 1)
        self.check()
        check_folder(self.out, POLICY, self.resume)
        executor = self.executor_of(self.workers)
        first = None
        if self.start_from is not None:
            first = training_path(self.start_from)
        elif not self.resume:
            first = policy_path(get_simulated(self.robot), None)
        return train_policy(
            self,
            lambda plans, report: train_guided(
                plans,
                first,
                self,
                self.out,
                resume=self.resume,
                options=options_of(self),
                report=report,
                executor=executor,
            ),
        )
