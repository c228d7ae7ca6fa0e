"""One tracking policy for both robots, against one for each: a short training of each.

All begin with the networks of the same checkpoint, whose observation gets two more
columns, the one-hot of the robot, with weights of zero. ``both`` learns on both robots
at once, half of its steps on each; ``go2`` and ``a1`` learn on one of them, as many
steps as ``both`` does on that robot. All else is that of ``loco-drake train tracker``.

Policies are scored in 4 s of the first plans of each label, without noise of actions
or starts, on both robots, whichever they were trained on. Each leaves a JSON file in
``--out``; what is there already is not done again, and a training that was stopped goes
on from its checkpoint. Prints the tables of docs/tracking.md. From the root of the
repository, with a folder of Motion files of each robot in ``--references``:

    OMP_NUM_THREADS=1 python benchmarks/one_policy.py --first checkpoint.safetensors
"""

import json
import resource
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from both_robots import SideBySide, mirror, widen, with_robot
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.control.plan import Plan
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.checkpoint import (
    load_checkpoint,
    restore,
    save_checkpoint,
    start_from,
)
from loco_drake.tracking.environment_config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.learning_curve import PROGRESS
from loco_drake.tracking.ppo import AdaptivePPO, PpoConfig, make_ppo
from loco_drake.tracking.references import load_references
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.workers import WorkerVecEnv

NO_NOISE = ResetNoise(joints=0.0, velocities=0.0, position=0.0, heading=0.0)
POINTS = (100_000, 250_000, 500_000)  # steps of a robot that the table shows

Scores = dict[str, dict[str, float]]


class Log(BaseCallback):
    """Writes a line and the checkpoints after each update.

    There is a checkpoint for each robot: they differ in the state of its sampler.
    """

    def __init__(self, folder: Path, samplers: Mapping[str, PlanSampler]) -> None:
        super().__init__()
        self._folder = folder
        self._samplers = samplers
        self._first = True
        self._start = time.monotonic()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        if not self._first:
            self.write()
        self._first = False

    def write(self) -> None:
        """Writes them."""
        learner = self.model
        assert isinstance(learner, AdaptivePPO)
        line = {
            "steps": learner.num_timesteps,
            "seconds": time.monotonic() - self._start,
            "rate": learner.rate,
            "kl": float(learner.logger.name_to_value["train/approx_kl"]),
            "std": float(learner.policy.log_std.detach().exp().mean()),
            "return": {k: s.score_by_label() for k, s in self._samplers.items()},
        }
        with (self._folder / PROGRESS).open("a") as log:
            log.write(json.dumps(line) + "\n")
        for name, sampler in self._samplers.items():
            save_checkpoint(checkpoint(self._folder, name), learner, sampler, {})


def checkpoint(folder: Path, robot: str) -> Path:
    """Returns where the checkpoint with a robot's sampler is."""
    return folder / f"{robot}.safetensors"


def score(
    learner: AdaptivePPO,
    robot: str,
    plans: Sequence[Plan],
    per_label: int,
    told: str | None = None,
) -> Scores:
    """Returns by label the mean normalized return and the share of episodes lost, %.

    Args:
        learner: whose mean action is taken.
        robot: name of the robot.
        plans: of the robot; the first of each label are followed from their start.
        per_label: plans of each label.
        told: the robot that the observations name, by default ``robot``.
    """
    told = told or robot
    config = EnvironmentConfig(robot=robot, reset_noise=NO_NOISE)
    labels = np.array([int(plan.labels[0]) for plan in plans])
    chosen = np.concatenate(
        [np.flatnonzero(labels == label)[:per_label] for label in np.unique(labels)]
    )
    if min(len(plans[k]) for k in chosen) <= config.episode_steps:
        raise InputError(f"Plans must be of more than {config.episode_steps} samples.")
    batch = TrackingBatch([plans[k] for k in chosen], config, len(chosen))
    normalizer = learner.get_vec_normalize_env()
    assert normalizer is not None
    random = np.random.default_rng(0)  # asked for, but there is nothing to draw
    for i in range(len(chosen)):
        batch.reset(i, random, i, 0)
    returns, follows = np.zeros(len(chosen)), np.ones(len(chosen), dtype=bool)
    for _ in range(config.episode_steps):
        seen: Any = normalizer.normalize_obs(with_robot(batch.observe(), told))
        terms, lost, _ = batch.step(learner.predict(seen, deterministic=True)[0])
        returns += follows * terms.sum(axis=-1)
        follows &= ~lost
        for fallen in np.flatnonzero(lost).tolist():
            batch.reset(fallen, random, fallen, 0)  # what it does now does not count
    figures: Scores = {}
    for label in np.unique(labels):
        own = labels[chosen] == label
        figures[str(LABELS[label])] = {
            "return": 100 * float(returns[own].mean()) / config.episode_steps,
            "lost": 100 * float(1 - follows[own].mean()),
        }
    return figures


@dataclass(frozen=True)
class Settings:
    """What all trainings share.

    Attributes:
        plans: by robot.
        per_worker: environments of each robot.
        ppo: how is learned.
        power: of PlanSampler.
        per_label: plans of each label that policies are scored on.
        seed: of everything random.
    """

    plans: Mapping[str, list[Plan]]
    per_worker: int
    ppo: PpoConfig
    power: float
    per_label: int
    seed: int


def train_and_score(
    settings: Settings, robots: Sequence[str], steps: int, first: Path, folder: Path
) -> dict[str, Any]:
    """Trains on ``robots``, or goes on with that, and scores on all robots.

    Args:
        settings: what all trainings share.
        robots: names; a worker process for each.
        steps: of each robot; with 0 the checkpoint is scored as it is.
        first: checkpoint to begin with.
        folder: for checkpoints and log.

    Returns:
        "steps" of each robot, "processor_s" of trainer and workers (None of a training
        that was stopped in between), "log", the lines of the log, and by robot and
        label "scores" and, of a training on several robots, "mistaken", the scores with
        observations that name the other robot.
    """
    folder.mkdir(parents=True, exist_ok=True)
    resumed = all(checkpoint(folder, name).exists() for name in robots)
    files = {name: checkpoint(folder, name) if resumed else first for name in robots}
    loaded = {name: load_checkpoint(file) for name, file in files.items()}
    done = loaded[robots[0]][1]["state"]["steps"] if resumed else 0
    before = _processor_s()
    samplers, parts = {}, {}
    for k, name in enumerate(robots):
        seed = settings.seed + k + done  # episodes after a stop are new ones
        samplers[name] = PlanSampler(settings.plans[name], seed, settings.power)
        parts[name] = WorkerVecEnv(
            settings.plans[name],
            EnvironmentConfig(robot=name),
            samplers[name],
            workers=1,
            per_worker=settings.per_worker,
            seed=seed,
        )
    environment = SideBySide(parts)
    try:
        learner = make_ppo(environment, settings.ppo, settings.seed, mirror)
        learner.set_logger(Logger(None, []))
        for name, (tensors, header) in loaded.items():
            if resumed:
                restore(learner, samplers[name], tensors, header["state"])
            else:
                start_from(learner, widen(tensors), header["state"])
        left = steps * len(robots) - learner.num_timesteps
        if left > 0:
            log = Log(folder, samplers)
            learner.learn(left, callback=log, reset_num_timesteps=False)
            log.write()
    finally:
        environment.close()
    spent = _processor_s() - before
    lines = folder / PROGRESS
    text = lines.read_text().splitlines() if lines.exists() else []
    plans, count = settings.plans, settings.per_label
    scores = {name: score(learner, name, plans[name], count) for name in ROBOTS}
    mistaken = {}
    if steps and len(robots) > 1:
        for name, other in zip(ROBOTS, reversed(ROBOTS), strict=True):
            mistaken[name] = score(learner, name, plans[name], count, other)
    return {
        "steps": learner.num_timesteps / len(robots),
        "processor_s": None if resumed else spent,
        "log": [json.loads(line) for line in text],
        "scores": scores,
        "mistaken": mistaken,
    }


def _processor_s() -> float:
    used = [
        resource.getrusage(who)
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    ]
    return sum(each.ru_utime + each.ru_stime for each in used)


def mean(scores: Scores, figure: str = "return") -> str:
    """Returns the mean over the labels, for a table."""
    return f"{np.mean([each[figure] for each in scores.values()]):.1f}"


def in_training(result: dict[str, Any], robot: str, steps: int) -> str:
    """Returns the mean over the labels of what the log says at a robot's ``steps``."""
    for line in result["log"]:
        if robot in line["return"] and line["steps"] >= steps * len(line["return"]):
            return f"{np.mean(list(line['return'][robot].values())):.1f}"
    return ""


def print_tables(results: Mapping[str, dict[str, Any]]) -> None:
    """Prints a row for each policy and robot, then one for each label."""
    points = [f"{point / 1e6:.2f}M" for point in POINTS]
    columns = ["robot", "policy", *points, "return", "mistaken", "least", "lost, %"]
    print(f"| {' | '.join([*columns, 'min'])} |")
    print("|---|---" + "|---:" * (len(columns) - 1) + "|")
    for robot in ROBOTS:
        for name, result in results.items():
            scores = result["scores"][robot]
            worst = min(scores, key=lambda label: scores[label]["return"])
            mistaken = result["mistaken"].get(robot)
            spent = result["processor_s"]
            cells = [
                robot,
                name,
                *(in_training(result, robot, point) for point in POINTS),
                mean(scores),
                mean(mistaken) if mistaken else "",
                f"{scores[worst]['return']:.1f} ({worst})",
                mean(scores, "lost"),
                f"{spent / 60:.1f}" if spent and result["log"] else "",
            ]
            print(f"| {' | '.join(cells)} |")
    names = [f"{robot}: {name}" for robot in ROBOTS for name in results]
    print(f"\n| label | {' | '.join(names)} |")
    print("|---" + "|---:" * len(names) + "|")
    for label in next(iter(results.values()))["scores"][ROBOTS[0]]:
        row = [
            f"{result['scores'][robot][label]['return']:.1f}"
            for robot in ROBOTS
            for result in results.values()
        ]
        print(f"| {label} | {' | '.join(row)} |", flush=True)


def main(
    first: Path,
    also: tuple[Path, ...] = (),
    references: Path = Path("motions/tracked"),
    out: Path = Path("runs/one_policy"),
    trainings: tuple[Literal["both", "go2", "a1"], ...] = ("both", "go2", "a1"),
    steps: int = 500_000,
    per_worker: int = 32,
    batch: int = 8192,
    power: float = 2.0,
    per_label: int = 5,
    seed: int = 0,
) -> None:
    """Trains what is not there yet and prints the tables.

    Args:
        first: checkpoint to begin with.
        also: further checkpoints to score, by the names of their files.
        references: holds the folders go2 and a1, of Motion files.
        out: for results, checkpoints and logs.
        trainings: which of them.
        steps: of each robot, in each training.
        per_worker: environments of each robot.
        batch: steps between updates.
        power: a gait's share of the steps is proportional to this power of its lack.
        per_label: plans of each label that policies are scored on.
        seed: of everything random.
    """
    jobs: dict[str, tuple[Sequence[str], int, Path]] = {
        "before": (ROBOTS, 0, first),
        **{path.stem: (ROBOTS, 0, path) for path in also},
        **{
            name: (ROBOTS if name == "both" else (name,), steps, first)
            for name in trainings
        },
    }
    settings: Settings | None = None
    results = {}
    for name, (robots, own, path) in jobs.items():
        file = out / f"{name}.json"
        if not file.exists():
            settings = settings or Settings(
                {r: load_references(get_robot(r), references / r) for r in ROBOTS},
                per_worker,
                PpoConfig(batch=batch),
                power,
                per_label,
                seed,
            )
            result = train_and_score(settings, robots, own, path, out / name)
            with atomic_path(file) as temporary:
                temporary.write_text(json.dumps(result) + "\n")
        results[name] = json.loads(file.read_text())
        print(f"{name} is done", flush=True)
    print_tables(results)


if __name__ == "__main__":
    tyro.cli(main)
