"""``loco-drake train student``: trains a policy without privileged observations."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from loco_drake.cli.options import SHIPPED, Json, OutFolder, option
from loco_drake.cli.training import train_policy
from loco_drake.common.errors import check_at_least
from loco_drake.tracking.config import StudentConfig


@dataclass(kw_only=True)
class TrainStudent(StudentConfig):
    """Teach a policy that needs no privileged observations to act as one that has them.

    It remembers its last measurements and estimates from them what it cannot measure
    (DAgger). Ctrl-C stops the training; --resume continues from the last batch.
    """

    NAME: ClassVar[str] = "student"
    teacher: Annotated[
        Path | None,
        option(
            f"Policy to learn from: a shipped one, {SHIPPED}; or the "
            "policy.safetensors of a run.",
            metavar="POLICY|FILE",
            default="the robot's main policy",
        ),
    ] = None
    # Folder of Motion files: those to track, such as `generate` writes. Required
    # without --resume.
    references: Annotated[Path | None, option(metavar="DIR", name="motions")] = None
    # Folder to write to: the checkpoint, policy and TensorBoard logs.
    out: OutFolder = Path("runs/student")
    # Randomize the world of each episode: friction, masses, motors, latency, pushes and
    # sensor noise. Parts without a range of their own use the standard range.
    randomize: bool = False
    # Continue what is in --out: from its checkpoint, with the options of that run, of
    # which only --steps may increase.
    resume: bool = False
    json: Json = None

    def run(self) -> int:
        """Trains, prints and writes; returns the exit status."""
        from loco_drake.common.run_folder import check_folder, options_of
        from loco_drake.models.shipped import training_path
        from loco_drake.tracking.train import POLICY
        from loco_drake.tracking.train_student import train_student

        check_at_least("steps", self.steps, 1)
        environment = self.environment
        if self.randomize:
            environment.randomization = environment.randomization.with_standard()
        self.check()
        check_folder(self.out, POLICY, self.resume)
        teacher = training_path(self.teacher or Path(environment.robot))
        return train_policy(
            self,
            lambda plans, report: train_student(
                plans,
                teacher,
                self,
                self.out,
                resume=self.resume,
                options=options_of(self),
                report=report,
            ),
        )
