"""``loco-drake train tracker``: the policy that follows plans."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

from loco_drake.cli.output import print_table, write_json
from loco_drake.cli.training import print_stopped
from loco_drake.common.errors import InputError
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.tracking.environment_config import EnvironmentConfig
from loco_drake.tracking.ppo import PpoConfig
from loco_drake.tracking.randomization import RandomizationConfig
from loco_drake.tracking.references import load_references
from loco_drake.tracking.terminations import TerminationConfig
from loco_drake.tracking.train import Progress as TrainingProgress
from loco_drake.tracking.train import TrainingConfig, train_tracker


@dataclass(kw_only=True)
class TrainTracker:
    """Train the tracking policy on a folder of Motion files, by PPO.

    Ctrl-C stops it after saving; --resume goes on from there.
    """

    references: Path
    """Folder of Motion files to follow, such as loco-drake generate writes."""
    out: Path = Path("runs/tracker")
    """Folder of checkpoint, policy and TensorBoard logs."""
    robot: str = "go2"
    """Robot: go2 or a1."""
    steps: int = 2_000_000
    """Environment steps in all, of 20 ms each."""
    workers: int = 2
    """Processes that simulate."""
    per_worker: int = 8
    """Environments in each process."""
    batch: int = PpoConfig.batch
    """Environment steps between updates; what is saved lags no more behind."""
    minibatch: int = PpoConfig.minibatch
    """Environment steps in a gradient step, of those of a batch."""
    plant: PlantConfig = field(default_factory=PlantConfig)
    """Contact solver, time step and friction."""
    randomize: bool = False
    """Draw friction, masses, motors, latency, pushes and noise anew for each episode:
    every part of --randomization that is not given gets its standard range."""
    randomization: RandomizationConfig = field(default_factory=RandomizationConfig)
    """Single parts of it; a range is two numbers."""
    termination: TerminationConfig = field(default_factory=TerminationConfig)
    """How far from its plan a robot may be before its episode ends."""
    homing: float = EnvironmentConfig.homing
    """What a step loses in training for each metre that the base is beside its plan,
    1/m; no part of the returns that are reported."""
    fall_cost: float = EnvironmentConfig.fall_cost
    """What a fall costs in training beyond the steps that it loses, in steps done
    perfectly; no part of the returns either."""
    privileged: bool = True
    """Whether the policy sees where in the world the base is and how fast it moves,
    which a robot outside simulation does not know well."""
    start_from: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """A checkpoint.safetensors, of any robot, with the networks to begin with."""
    seed: int = 0
    """Of everything random."""
    resume: bool = False
    """Go on from the checkpoint in the folder."""
    json: Path | None = None
    """Write the figures to a file."""

    def run(self) -> int:
        """Trains, prints and writes; returns the exit status."""
        robot = get_robot(self.robot)
        for name in ("steps", "workers", "per_worker", "minibatch"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} must be at least 1.")
        environments = self.workers * self.per_worker
        if self.batch < 2 * environments:
            raise InputError(
                f"--batch must be at least {2 * environments}, two steps of each of "
                f"{environments} environments, not {self.batch}."
            )
        self.plant.check()
        self.termination.check()
        for name in ("homing", "fall_cost"):
            if not getattr(self, name) >= 0:
                option = "--" + name.replace("_", "-")
                raise InputError(
                    f"{option} must be at least 0, not {getattr(self, name)}."
                )
        randomization = self.randomization
        if self.randomize:
            randomization = randomization.with_standard()
        randomization.check(robot, self.plant)
        environment = EnvironmentConfig(
            robot=self.robot,
            plant=self.plant,
            termination=self.termination,
            homing=self.homing,
            fall_cost=self.fall_cost,
            randomization=randomization,
        )
        if not self.privileged:
            environment = environment.without_position()
        plans = load_references(robot, self.references)
        config = TrainingConfig(
            steps=self.steps,
            workers=self.workers,
            per_worker=self.per_worker,
            seed=self.seed,
            environment=environment,
            ppo=PpoConfig(
                batch=self.batch,
                minibatch=min(self.batch, self.minibatch),
                privileged=self.privileged,
            ),
        )
        # A second thread gains little, and spins where another program has its core.
        torch.set_num_threads(1)
        bar = Progress(
            TextColumn("steps"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            TextColumn("return {task.fields[score]:.1f} of 100"),
        )
        with bar:
            task = bar.add_task("steps", total=self.steps, score=0.0)

            def report(progress: TrainingProgress) -> None:
                score = float(np.mean(list(progress.scores.values())))
                bar.update(task, completed=progress.steps, score=score)

            figures = train_tracker(
                plans,
                config,
                self.out,
                resume=self.resume,
                first=self.start_from,
                report=report,
            )
        write_json(self.json, figures)
        rows = [(label, f"{score:.1f}") for label, score in figures["scores"].items()]
        print_table("Recent training returns, of 100", ("gait", "return"), rows)
        if figures["interrupted"]:
            return print_stopped(figures["steps"], self.steps)
        return 0
