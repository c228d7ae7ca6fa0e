"""What the environments of training cost: beyond the plant, by two workers, in memory.

*Against the plant.* The environments of one worker, 16 robots, are stepped with zero
actions on generated references, resets included. The bare plant (plant and scene graph,
nothing else) is stepped as often at the same rate, in the same episodes: it starts in
the same states and is sent the same targets, so that its legs swing and land as often;
resets are not counted. They take turns in one process, and medians of its processor
time are compared, so that a busy machine does little harm.

*Two workers against one.* Both are there from the start and take turns, and the ratio
is the median over the turns. This is wall-clock time, and needs two idle cores.

*Memory.* The resident memory of trainer and workers in a training of many small
batches, after the first tenth of them and at the end.

Run it from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/environment.py
"""

import multiprocessing
import os
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
import torch
import tyro
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.cli.output import write_json
from loco_drake.control.action import set_points
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.models.plant import AddRobotPlant, ConfigureSimulator, PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, PpoConfig, TrainingConfig
from loco_drake.tracking.randomization import STANDARD, RandomizationConfig
from loco_drake.tracking.references import generate_references
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.train import train_tracker
from loco_drake.tracking.workers import WorkerVecEnv

ROBOT = "go2"
ROBOTS = 16  # in a worker
BATCH = 256  # of the training whose memory is measured


@dataclass
class Episode:
    """What the environment did: ``steps`` from sample ``first`` of a plan."""

    plan: Plan
    first: int
    steps: int = 0


def run_environment(
    batch: TrackingBatch, plans: list[Plan], random: np.random.Generator, steps: int
) -> tuple[float, list[Episode]]:
    """Does ``steps`` in all; returns the seconds they took and the episodes."""

    def reset(i: int) -> Episode:
        batch.reset(i, random)
        episodes.append(Episode(plans[batch.plan[i]], int(batch.start[i])))
        return episodes[-1]

    episodes: list[Episode] = []
    actions = np.zeros((ROBOTS, 12))
    start = time.process_time()
    current = [reset(i) for i in range(ROBOTS)]
    for _ in range(steps // ROBOTS):
        _, terminated, truncated = batch.step(actions)
        batch.observe()
        for episode in current:
            episode.steps += 1
        ended = np.flatnonzero(terminated | truncated)
        for i in ended:
            current[i] = reset(int(i))
        if len(ended):
            batch.observe(ended)
    return time.process_time() - start, episodes


class BarePlant:
    """Steps a diagram of plant and scene graph."""

    def __init__(self, config: PlantConfig) -> None:
        self._robot = get_robot(ROBOT)
        builder = DiagramBuilder()
        self._plant, _, instance = AddRobotPlant(builder, self._robot, config)
        self._simulator = Simulator(builder.Build())
        ConfigureSimulator(self._simulator, config)
        self._context = self._plant.GetMyMutableContextFromRoot(
            self._simulator.get_mutable_context()
        )
        self._targets = self._plant.get_desired_state_input_port(instance).FixValue(
            self._context, np.zeros(24)
        )

    def follow(self, episode: Episode) -> float:
        """Does what the environment did; returns the seconds spent stepping."""
        plan, first = episode.plan, episode.first
        self._simulator.get_mutable_context().SetTime(0.0)
        self._plant.SetPositionsAndVelocities(self._context, plan.state[first])
        self._simulator.Initialize()
        samples = np.minimum(first + 1 + np.arange(episode.steps), len(plan) - 1)
        targets = set_points(self._robot, plan)[samples]
        desired = np.hstack((targets, np.zeros_like(targets)))
        start = time.process_time()
        for step, value in enumerate(desired, start=1):
            self._targets.GetMutableData().get_mutable_value().set_value(value)
            self._simulator.AdvanceTo(step * PLAN_DT, interruptible=False)
        return time.process_time() - start


def against_plant(
    plans: list[Plan], config: EnvironmentConfig, steps: int, turns: int
) -> dict[str, float]:
    """Returns steps/s of the environments and of the bare plant, and their ratio."""
    batch, bare = TrackingBatch(plans, config, ROBOTS), BarePlant(config.plant)
    random = np.random.default_rng(0)
    pairs = []
    for count in (100, *[steps] * turns):
        own, episodes = run_environment(batch, plans, random, count)
        pairs.append((own, sum(map(bare.follow, episodes))))
    del pairs[0]  # warmed up
    return {
        "environment_steps_per_second": steps / median(own for own, _ in pairs),
        "plant_steps_per_second": steps / median(plant for _, plant in pairs),
        "ratio_to_plant": median(plant / own for own, plant in pairs),
    }


def two_workers(
    plans: list[Plan], config: EnvironmentConfig, steps: int, turns: int
) -> dict[str, float]:
    """Returns steps/s of one worker and of two, and their ratio."""
    both = [
        WorkerVecEnv(
            plans,
            config,
            PlanSampler(plans, 0),
            workers=workers,
            per_worker=ROBOTS,
            seed=0,
        )
        for workers in (1, 2)
    ]

    def steps_per_second(environments: WorkerVecEnv, steps: int) -> float:
        actions = np.zeros((environments.num_envs, 12), dtype=np.float32)
        start = time.perf_counter()
        for _ in range(steps):
            environments.step(actions)
        return steps * environments.num_envs / (time.perf_counter() - start)

    for environments in both:
        environments.reset()
        steps_per_second(environments, 10)  # warm
    turn = steps // ROBOTS
    rates = [[steps_per_second(each, turn) for each in both] for _ in range(turns)]
    for environments in both:
        environments.close()
    return {
        "one_worker_steps_per_second": median(one for one, _ in rates),
        "two_workers_steps_per_second": median(two for _, two in rates),
        "ratio_of_workers": median(two / one for one, two in rates),
    }


def memory(
    plans: list[Plan], config: EnvironmentConfig, batches: int
) -> dict[str, float]:
    """Returns the MB of trainer and workers, early and at the end of a training."""
    sizes: list[dict[str, float]] = []

    def resident(pid: int) -> float:
        command = ["ps", "-o", "rss=", "-p", str(pid)]
        return int(subprocess.check_output(command, text=True)) / 1024

    def report(steps: int, scores: dict[str, float]) -> None:
        workers = sorted(child.pid or 0 for child in multiprocessing.active_children())
        named = {f"worker_{k}": resident(pid) for k, pid in enumerate(workers)}
        sizes.append({"trainer": resident(os.getpid()), **named})

    training = TrainingConfig(
        steps=(batches + 1) * BATCH,  # the last is not reported
        per_worker=ROBOTS,
        environment=config,
        ppo=PpoConfig(batch=BATCH, minibatch=BATCH, epochs=1),
    )
    with tempfile.TemporaryDirectory() as folder:
        train_tracker(plans, training, Path(folder), report=report)
    places = {"early": sizes[len(sizes) // 10], "late": sizes[-1]}
    return {
        f"{name}_mb_{when}": size
        for when, own in places.items()
        for name, size in own.items()
    }


def main(
    steps: int = 320,
    turns: int = 15,
    batches: int = 100,
    contact: str = "similar",
    time_step: float = 0.01,
    randomize: bool = False,
    json: Path | None = None,
) -> None:
    """Measures and prints.

    Args:
        steps: of a worker in each turn.
        turns: medians are of.
        batches: of the training.
        contact: solver.
        time_step: of the physics, s.
        randomize: draw worlds in the environment.
        json: where to write the figures.
    """
    torch.set_num_threads(1)
    gaits = ("dog-pace", "dog-trot")
    plans = generate_references(get_robot(ROBOT), gaits, count=4, seconds=6.0, seed=0)
    config = EnvironmentConfig(
        robot=ROBOT,
        plant=PlantConfig(contact=contact, time_step=time_step),
        randomization=STANDARD if randomize else RandomizationConfig(),
    )
    figures = {
        **against_plant(plans, config, steps, turns),
        **two_workers(plans, config, steps, turns),
        **memory(plans, config, batches),
    }
    for name, value in figures.items():
        print(f"{name.replace('_', ' '):30} {value:9.2f}")
    write_json(json, figures)


if __name__ == "__main__":
    tyro.cli(main)
