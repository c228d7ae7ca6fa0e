"""The command ``generate``."""

from dataclasses import dataclass
from functools import partial
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
    WorkerOptions,
    option,
)
from loco_drake.cli.output import do_all, print_table, tracked, write_json
from loco_drake.common.errors import check_at_least
from loco_drake.motion.gaits import parse_schedule
from loco_drake.motion.motion import FPS
from loco_drake.motion.motion_file import write_motion


@dataclass(kw_only=True)
class Generate(WorkerOptions):
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
        from loco_drake.control.motion_batches import BatchMaker, Order, batches
        from loco_drake.generation import generate
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import chosen_weights

        schedule = parse_schedule(self.gait)
        generate.check_duration(self.duration)
        schedule.check_ends_by(self.duration)
        generate.check_sampling(self.temperature, self.top_p, self.pace)
        if self.tell is not None:
            generate.check_velocity(self.tell)
        get_robot(self.robot)
        executor = self.executor
        check_at_least("count", self.count, 1)
        check_at_least("seed", self.seed, 0)
        found = chosen_weights(
            self.weights, tokenizer=self.tokenizer, generator=self.generator
        )
        order = Order(
            robot=self.robot,
            tokenizer=found["tokenizer"],
            generator=found["generator"],
            schedule=schedule,
            duration=self.duration,
            temperature=self.temperature,
            top_p=self.top_p,
            speed_rank=self.pace,
            velocity=self.tell,
            steer=self.steer,
            ground=self.ground,
        )
        seeds = batches(self.seed, self.count)
        made = executor.map(partial(BatchMaker, order), seeds)
        done = tracked(made, "Generating", len(seeds))
        seconds, frames, tokens = 0.0, 0, 0.0
        for own, batch in zip(seeds, done, strict=True):
            for seed, content in zip(own, batch.files, strict=True):
                write_motion(content, self.out / f"{schedule}-{seed}.npz")
            seconds += batch.seconds
            frames += batch.frames
            tokens += batch.tokens
        figures = {
            "count": self.count,
            "frames_per_second": frames / seconds,
            "tokens_per_second": tokens / seconds,
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
