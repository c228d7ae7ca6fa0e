"""Generation of Motion files in batches, of which each worker makes one at a time."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from loco_drake.control.steered_motion import steered_motion
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import motion_model_of
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import GaitSchedule
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_file import motion_bytes
from loco_drake.retargeting.grounding import ground
from loco_drake.retargeting.inverse_kinematics import LegSolver

BATCH = 32  # motions side by side; batching changes their last bits


@dataclass(frozen=True, kw_only=True)
class Order:
    """What to generate; see :func:`.generate_motions` for what has no comment."""

    robot: str
    tokenizer: Path | None  # weights; None: the shipped ones
    generator: Path | None  # likewise
    schedule: GaitSchedule
    duration: float
    temperature: float = 1.0
    top_p: float = 0.95
    speed_rank: float | None = None
    velocity: tuple[float, float, float] | None = None
    steer: bool = False  # along the path of commands that the seed draws
    ground: bool = False  # move the trunk until it obeys physics


@dataclass(frozen=True)
class Batch:
    """What came of some seeds."""

    files: list[bytes]  # content of a Motion file for each seed
    frames: int
    tokens: float
    seconds: float  # of generating, without steering and grounding


class BatchMaker:
    """Generates batches; loads the model once.

    Raises:
        InputError: if the weights are missing or damaged, or an argument is wrong.
    """

    def __init__(self, order: Order) -> None:
        self._order = order
        self._model = motion_model_of(order.robot, order.tokenizer, order.generator)
        self._solver = LegSolver(self._model.robot, FPS) if order.ground else None

    def __call__(self, seeds: Sequence[int]) -> Batch:
        """Returns the motions of seeds, at most BATCH."""
        order, robot = self._order, self._model.robot
        start = time.perf_counter()
        motions = generate_motions(
            self._model,
            order.schedule,
            order.duration,
            seeds,
            temperature=order.temperature,
            top_p=order.top_p,
            speed_rank=order.speed_rank,
            velocity=order.velocity,
        )
        seconds = time.perf_counter() - start
        motions = [
            finished(motion, robot, seed, steer=order.steer, solver=self._solver)
            for motion, seed in zip(motions, seeds, strict=True)
        ]
        frames = sum(map(len, motions))
        return Batch(
            files=[motion_bytes(motion) for motion in motions],
            frames=frames,
            tokens=frames / self._model.frames_per_token,
            seconds=seconds,
        )


def finished(
    motion: Motion, robot: Robot, seed: int, *, steer: bool, solver: LegSolver | None
) -> Motion:
    """Returns a motion as it is wanted, given the seed that it was generated with.

    It is steered along the path of commands that the seed draws if ``steer``, and made
    to obey physics if there is a solver.
    """
    if steer:
        motion = steered_motion(robot, motion, seed)
    return motion if solver is None else ground(motion, robot, solver).motion


def batches(first: int, count: int) -> list[range]:
    """Returns the seeds of each batch, of ``count`` seeds from ``first`` on."""
    end = first + count
    return [range(k, min(k + BATCH, end)) for k in range(first, end, BATCH)]
