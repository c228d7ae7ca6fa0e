"""The command ``generate``."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from loco_drake.cli.options import (
    SCHEDULE,
    Generator,
    Json,
    OutFolder,
    Robot,
    Tokenizer,
    Weights,
    option,
)
from loco_drake.cli.output import do_all, print_table, write_json
from loco_drake.common.errors import check_at_least, check_choice
from loco_drake.motion.gaits import parse_schedule
from loco_drake.motion.motion import FPS
from loco_drake.motion.motion_file import save_motion

BATCH = 32  # motions side by side


@dataclass(kw_only=True)
class Generate:
    """Generate motion of a gait and write Motion files at 50 frames/s."""

    gait: Annotated[str, option(f"{SCHEDULE}.", metavar="GAIT")] = "dog-trot"
    # Duration in s: of each motion, above 0 and at most 600.
    duration: float = 10.0
    # Number of motions.
    count: int = 1
    # Seed: of the first motion, and 1 more of each further one.
    seed: int = 0
    robot: Robot = "go2"
    # Folder to write to: the Motion files.
    out: OutFolder = Path("motions/generated")
    # Speed rank, from 0 (slowest recorded speed of the gait) to 1 (fastest).
    pace: Annotated[
        float | None, option(name="speed-rank", default="drawn for each seed")
    ] = None
    # Velocity that the generator is told: forward, sideways m/s and yaw rate rad/s, in
    # the heading frame; the nearest that was recorded of the gait is told.
    tell: Annotated[tuple[float, float, float] | None, option(metavar="VX VY WZ")] = (
        None
    )
    # Steer each motion by commands drawn every 2 s: along another path, sideways,
    # faster, slower and backwards, see docs/driving.md.
    steer: bool = False
    # Make motion obey physics: move the trunk until the feet's forces explain its
    # motion, as `retarget --ground` does; some ms a frame.
    ground: bool = False
    # Sampling temperature: above 1 more varied, below 1 more typical, 0 greedy.
    temperature: float = 1.0
    # Sample from the likeliest codes that together have this probability.
    top_p: float = 0.95
    tokenizer: Tokenizer = None
    generator: Generator = None
    weights: Weights = None
    json: Json = None

    def run(self) -> int:
        """Writes the files and prints the figures; returns 0."""
        from loco_drake.control.steered_motion import steered_motion
        from loco_drake.generation import generate
        from loco_drake.generation.motion_model import motion_model_of
        from loco_drake.models.robots import ROBOTS
        from loco_drake.models.shipped import chosen_weights
        from loco_drake.retargeting.grounding import ground
        from loco_drake.retargeting.inverse_kinematics import LegSolver

        schedule = parse_schedule(self.gait)
        generate.check_duration(self.duration)
        schedule.check_ends_by(self.duration)
        generate.check_sampling(self.temperature, self.top_p, self.pace)
        if self.tell is not None:
            generate.check_velocity(self.tell)
        check_choice("robot", self.robot, ROBOTS)
        check_at_least("count", self.count, 1)
        check_at_least("seed", self.seed, 0)
        found = chosen_weights(
            self.weights, tokenizer=self.tokenizer, generator=self.generator
        )
        model = motion_model_of(self.robot, found["tokenizer"], found["generator"])
        solver = LegSolver(model.robot, FPS) if self.ground else None
        seconds, frames = 0.0, 0
        for first in range(self.seed, self.seed + self.count, BATCH):
            seeds = range(first, min(first + BATCH, self.seed + self.count))
            start = time.perf_counter()
            motions = generate.generate_motions(
                model,
                schedule,
                self.duration,
                seeds,
                temperature=self.temperature,
                top_p=self.top_p,
                speed_rank=self.pace,
                velocity=self.tell,
            )
            seconds += time.perf_counter() - start
            for seed, motion in zip(seeds, motions, strict=True):
                if self.steer:
                    motion = steered_motion(model.robot, motion, seed)
                if self.ground:
                    motion = ground(motion, model.robot, solver).motion
                save_motion(motion, self.out / f"{schedule}-{seed}.npz")
                frames += len(motion)
        figures = {
            "count": self.count,
            "frames_per_second": frames / seconds,
            "tokens_per_second": frames / model.frames_per_token / seconds,
            "times_real_time": frames / FPS / seconds,
        }
        rows = [
            [key.replace("_", " "), f"{value:.4g}"] for key, value in figures.items()
        ]
        title = f"{self.count} motions of {self.duration:g} s in {self.out}"
        do_all(
            lambda: print_table(title, ["figure", "value"], rows),
            lambda: write_json(self.json, figures),
        )
        return 0
