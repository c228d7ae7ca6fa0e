"""How fast recordings are retargeted: frames/s on one core, and what workers bring.

Rounds of one process and of several take turns, so that a busy machine slows both; the
ratio of their speeds is that of the medians. A round is timed from its first result to
its last, when all processes have started, and as a whole. What processor time the
processes were given beside other work, and what they made of it, is printed too: two
workers cannot be faster than one where there are no two free cores. Needs the
recordings. Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/retargeting.py
"""

import os
import statistics
import time
from pathlib import Path

import tyro

from loco_drake.datasets.registry import data_dir
from loco_drake.datasets.segments import Segment, read_segments
from loco_drake.evaluation.retargeting import ClipScore, score_segments
from loco_drake.models.robots import Robot, get_robot

FIGURES = (
    "frames/s once started",
    "frames/s overall",
    "cores given",
    "frames per second of processor time",
)


def frames_per_second(
    segments: list[Segment], robot: Robot, workers: int
) -> tuple[float, float, float, float]:
    """Returns how fast a round is.

    Returns:
        Frames per second of wall time once all have started, and overall; cores that
        were given to all processes on average; frames per second of processor time.
    """
    frames, first, began, given = 0, 0.0, time.perf_counter(), processor_seconds()
    for score in score_segments(segments, robot, workers):
        if not first:
            first = time.perf_counter()
        elif isinstance(score, ClipScore):
            frames += score.report.frames
    end = time.perf_counter()
    used = processor_seconds() - given
    return (
        frames / (end - first),
        frames / (end - began),
        used / (end - began),
        frames / used,
    )


def processor_seconds() -> float:
    """Returns the processor time of this process and of its children that ended."""
    times = os.times()
    return sum(times[:4])


def main(
    robot: str = "go2", workers: int = 2, rounds: int = 5, data: Path | None = None
) -> None:
    """Prints the speeds and their ratio."""
    segments = read_segments(data_dir(data))
    one, many = [], []
    for _ in range(rounds):
        one.append(frames_per_second(segments, get_robot(robot), 1))
        many.append(frames_per_second(segments, get_robot(robot), workers))
    print(f"{robot}, {len(segments)} stretches, medians of {rounds} rounds")
    print(f"| | one process | {workers} workers | ratio |")
    print("|---|---:|---:|---:|")
    for index, name in enumerate(FIGURES):
        alone = statistics.median(figures[index] for figures in one)
        shared = statistics.median(figures[index] for figures in many)
        print(f"| {name} | {alone:.4g} | {shared:.4g} | {shared / alone:.2f} |")


if __name__ == "__main__":
    tyro.cli(main)
