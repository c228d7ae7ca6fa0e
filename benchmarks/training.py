"""What training gains from a second worker, and whether its memory grows.

Steps/s of the environments of two workers over those of one, 16 robots each: both are
there from the start and take turns, and the ratio is the median over the turns. This is
wall-clock time, and needs two idle cores. Then a training of many small batches: the
resident memory of trainer and workers after the first tenth of them and at the end.
Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/training.py
"""

import multiprocessing
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
import tyro
from environment import ROBOT, ROBOTS, make_plans

from loco_drake.cli.output import write_json
from loco_drake.control.plan import Plan
from loco_drake.tracking.config import EnvironmentConfig, PpoConfig, TrainingConfig
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.train import Progress, train_tracker
from loco_drake.tracking.workers import WorkerVecEnv

_BATCH = 256


def make_workers(plans: list[Plan], workers: int) -> WorkerVecEnv:
    """Returns environments in ``workers`` processes, reset and warm."""
    environments = WorkerVecEnv(
        plans,
        EnvironmentConfig(robot=ROBOT),
        PlanSampler(plans, 0),
        workers=workers,
        per_worker=ROBOTS,
        seed=0,
    )
    environments.reset()
    steps_per_second(environments, 10)
    return environments


def steps_per_second(environments: WorkerVecEnv, steps: int) -> float:
    """Steps all environments ``steps`` times; returns environment steps a second."""
    actions = np.zeros((environments.num_envs, 12), dtype=np.float32)
    start = time.perf_counter()
    for _ in range(steps):
        environments.step(actions)
    return steps * environments.num_envs / (time.perf_counter() - start)


def scaling(plans: list[Plan], steps: int, turns: int) -> dict[str, float]:
    """Returns steps/s of one worker and of two, and their ratio."""
    one, two = make_workers(plans, 1), make_workers(plans, 2)
    rates = [
        (steps_per_second(one, steps), steps_per_second(two, steps))
        for _ in range(turns)
    ]
    one.close()
    two.close()
    return {
        "one_worker_steps_per_second": statistics.median(a for a, _ in rates),
        "two_workers_steps_per_second": statistics.median(b for _, b in rates),
        "ratio": statistics.median(b / a for a, b in rates),
    }


def resident(pid: int) -> float:
    """Returns the resident memory of a process in MB."""
    printed = subprocess.check_output(["ps", "-o", "rss=", "-p", str(pid)], text=True)
    return int(printed) / 1024


def memory(plans: list[Plan], iterations: int) -> dict[str, list[float]]:
    """Returns the MB of trainer and workers, early and at the end of a training."""
    sizes: list[dict[str, float]] = []

    def report(progress: Progress) -> None:
        workers = sorted(child.pid or 0 for child in multiprocessing.active_children())
        named = {"trainer": os.getpid()}
        named |= {f"worker {k}": pid for k, pid in enumerate(workers)}
        sizes.append({name: resident(pid) for name, pid in named.items()})

    config = TrainingConfig(
        steps=(iterations + 1) * _BATCH,  # the last is not reported
        per_worker=ROBOTS,
        environment=EnvironmentConfig(robot=ROBOT),
        ppo=PpoConfig(batch=_BATCH, minibatch=_BATCH, epochs=1),
    )
    with tempfile.TemporaryDirectory() as folder:
        train_tracker(plans, config, Path(folder), report=report)
    first, last = sizes[len(sizes) // 10], sizes[-1]
    return {name: [first[name], last[name]] for name in first}


def main(
    steps: int = 30, turns: int = 15, iterations: int = 100, json: Path | None = None
) -> None:
    """Measures and prints.

    Args:
        steps: of each, in each turn.
        turns: medians are of.
        iterations: batches of the training.
        json: where to write the figures.
    """
    torch.set_num_threads(1)
    plans = make_plans()
    speed = scaling(plans, steps, turns)
    for name, value in speed.items():
        print(f"{name.replace('_', ' '):30} {value:8.2f}")
    grown = memory(plans, iterations)
    print(f"\nMB after {iterations // 10} and {iterations} batches:")
    for name, (first, last) in grown.items():
        print(f"{name:30} {first:8.1f} {last:8.1f}")
    write_json(json, {"scaling": speed, "resident_mb": grown})


if __name__ == "__main__":
    tyro.cli(main)
