"""What it costs to share work among processes, here or on a Ray cluster.

*Overhead.* Tasks that do nothing are mapped; a training's messages, of their true size,
are exchanged with workers that do nothing. Time and bytes are those of a task and of a
step of one worker's robots.

*More workers against one.* Episodes of a Go2 are simulated, the environments of a
training stepped and, if there are recordings, clips retargeted, by one worker and by
more in turns; the ratio of work per second is the median over the turns. It needs as
many idle cores as workers.

Run it from the root of the repository, on the engines to be compared:

    OMP_NUM_THREADS=1 python benchmarks/machines.py --engines local ray --workers 2
"""

import pickle
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
import tyro

from loco_drake.cli.output import write_json
from loco_drake.control.plan import Plan
from loco_drake.datasets.registry import data_dir
from loco_drake.datasets.segments import Segment, read_segments
from loco_drake.engine.choice import make_executor
from loco_drake.engine.executor import Executor
from loco_drake.evaluation.tracking_table import generated_trials, run_trials
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import policy_path
from loco_drake.retargeting.retarget import retarget_segments
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.references import generate_references
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.simulation import Reply, Step
from loco_drake.tracking.workers import WorkerVecEnv

ROBOTS = 16  # of a worker in training
GAITS = ("dog-pace", "dog-trot")


def nothing() -> Callable[[int], int]:
    """Returns a function whose calls cost what a task costs at least."""
    return int


def echo(reply: Reply) -> Callable[[Step], Reply]:
    """Returns a function that answers as a worker does, at once."""
    return lambda _: reply


def messages(plans: list[Plan]) -> tuple[Step, Reply]:
    """Returns what a worker is sent and what it answers, in the middle of training."""
    environments = WorkerVecEnv(
        plans,
        EnvironmentConfig(),
        PlanSampler(plans, 0),
        workers=1,
        per_worker=ROBOTS,
        seed=0,
    )
    try:
        environments.reset()
        sent: list[Step] = []
        replies: list[Reply] = []
        crew = environments._crew
        send, receive = crew.send, crew.receive

        def noted_send(worker: int, message: Any) -> None:
            sent.append(message)
            send(worker, message)

        def noted_receive(worker: int) -> Any:
            replies.append(receive(worker))
            return replies[-1]

        crew.send, crew.receive = noted_send, noted_receive  # type: ignore[method-assign]
        for _ in range(3):
            environments.step(np.zeros((ROBOTS, 12), dtype=np.float32))
    finally:
        environments.close()
    return sent[-1], replies[-1]


def overhead(
    executor: Executor, step: Step, reply: Reply, tasks: int
) -> dict[str, float]:
    """Returns the ms of a task that does nothing, and of a step's messages."""
    done = executor.map(nothing, range(tasks))
    next(done)  # the workers have started
    start = time.perf_counter()
    left = sum(1 for _ in done)
    of_task = (time.perf_counter() - start) / left
    count = executor.workers
    crew = executor.crew(echo, [reply] * count)
    times = []
    try:
        for _ in range(tasks):
            start = time.perf_counter()
            for worker in range(count):
                crew.send(worker, step)
            for worker in range(count):
                crew.receive(worker)
            times.append(time.perf_counter() - start)
    finally:
        crew.close()
    return {"task_ms": 1e3 * of_task, "step_messages_ms": 1e3 * median(times)}


def simulated(executor: Executor, episodes: int) -> float:
    """Returns simulated episodes of 5 s per second, the workers' start not counted."""
    scenario = Scenario(
        robot="go2",
        reference=GeneratedReference(gait=GAITS[1], duration=5.0),
        policy=TrainedPolicy(weights=policy_path(get_robot("go2"))),
    )
    count = executor.workers
    trials = generated_trials([GAITS[1]], range(episodes + count), 5.0)
    done = run_trials(scenario, trials, executor)
    for _ in range(count):
        next(done)
    start = time.perf_counter()
    left = sum(1 for _ in done)
    return left / (time.perf_counter() - start)


def stepped(executor: Executor, plans: list[Plan], steps: int) -> float:
    """Returns environment steps per second of the workers of a training."""
    environments = WorkerVecEnv(
        plans,
        EnvironmentConfig(),
        PlanSampler(plans, 0),
        workers=executor.workers,
        per_worker=ROBOTS,
        seed=0,
        executor=executor,
    )
    actions = np.zeros((environments.num_envs, 12), dtype=np.float32)
    try:
        environments.reset()
        for _ in range(10):
            environments.step(actions)
        start = time.perf_counter()
        for _ in range(steps):
            environments.step(actions)
        return steps * environments.num_envs / (time.perf_counter() - start)
    finally:
        environments.close()


def retargeted(executor: Executor, segments: Sequence[Segment]) -> float:
    """Returns clips retargeted per second, the workers' start not counted."""
    count = executor.workers
    with TemporaryDirectory() as folder:
        clips = [*segments[:count], *segments]
        done = retarget_segments(clips, get_robot("go2"), Path(folder), None, executor)
        for _ in range(count):
            next(done)
        start = time.perf_counter()
        left = sum(1 for _ in done)
        return left / (time.perf_counter() - start)


def speedups(
    executors: Sequence[Executor], work: Callable[[Executor], float], turns: int
) -> tuple[float, list[float]]:
    """Returns the first's work per second, and how many times it each other does."""
    rates = [[work(executor) for executor in executors] for _ in range(turns)]
    ratios = [median(r[i] / r[0] for r in rates) for i in range(1, len(executors))]
    return median(r[0] for r in rates), ratios


def main(
    engines: tuple[str, ...] = ("local", "ray"),
    workers: tuple[int, ...] = (2,),
    tasks: int = 300,
    episodes: int = 20,
    steps: int = 200,
    clips: int = 0,
    turns: int = 5,
    ray_address: str | None = None,
    json: Path | None = None,
) -> None:
    """Measures and prints.

    Args:
        engines: local, ray or both.
        workers: numbers of them to compare one worker with.
        tasks: of which overheads are means.
        episodes: of 5 s, that are simulated in each turn; 0 for none.
        steps: of each environment in each turn; 0 for none.
        clips: that are retargeted in each turn, of the recordings in
            ``LOCO_DRAKE_DATA``; 0 for none.
        turns: medians are of.
        ray_address: of the Ray cluster.
        json: where to write the figures.
    """
    torch.set_num_threads(1)
    plans = generate_references(get_robot("go2"), GAITS, count=4, seconds=6.0, seed=0)
    step, reply = messages(plans)
    figures: dict[str, float] = {
        "step_sent_bytes": len(pickle.dumps(step, -1)),
        "step_answered_bytes": len(pickle.dumps(reply, -1)),
    }
    for engine in engines:
        address = ray_address if engine == "ray" else None
        # Ray's own cluster has as many cores as its first work wants.
        most_first = sorted({*workers, 1}, reverse=True)
        executors = [make_executor(engine, n, address) for n in most_first]
        found = overhead(executors[0], step, reply, tasks)
        works: dict[str, Callable[[Executor], float]] = {}
        if episodes:
            works["episodes"] = partial(simulated, episodes=episodes)
        if steps:
            works["steps"] = partial(stepped, plans=plans, steps=steps)
        if clips:
            segments = read_segments(data_dir())[:clips]
            works["clips"] = partial(retargeted, segments=segments)
        for name, work in works.items():
            rate, ratios = speedups(executors[::-1], work, turns)
            found[f"{name}_per_second"] = rate
            for count, ratio in zip(most_first[-2::-1], ratios, strict=True):
                found[f"{name}_ratio_of_{count}"] = ratio
        figures |= {f"{engine}_{name}": value for name, value in found.items()}
    for name, value in figures.items():
        print(f"{name.replace('_', ' '):36} {value:10.3f}")
    write_json(json, figures)


if __name__ == "__main__":  # workers import this file again
    tyro.cli(main)
