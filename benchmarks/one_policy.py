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
from typing import Any

import gymnasium
import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor

from loco_drake.errors import InputError
from loco_drake.files import atomic_path
from loco_drake.gaits import LABELS
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.systems.observation import OBSERVATION_SIZE
from loco_drake.systems.plan import Plan
from loco_drake.systems.symmetry import mirror_observations
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.checkpoint import (
    load_checkpoint,
    restore,
    save_checkpoint,
    start_from,
)
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.environment import ACTION_SPACE
from loco_drake.tracking.learning_curve import PROGRESS
from loco_drake.tracking.ppo import AdaptivePPO, PpoConfig, make_ppo
from loco_drake.tracking.references import load_references
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.workers import WorkerVecEnv

SIZE = OBSERVATION_SIZE + len(ROBOTS)
NO_NOISE = ResetNoise(joints=0.0, velocities=0.0, position=0.0, heading=0.0)
# The first layers of actor and critic, in a checkpoint.
FIRST_LAYERS = [
    f"policy/mlp_extractor.{net}_net.0.weight" for net in ("policy", "value")
]
POINTS = (100_000, 250_000, 500_000)  # steps of a robot that the table shows

Scores = dict[str, dict[str, float]]


def with_robot(observations: NDArray[np.float32], robot: str) -> NDArray[np.float32]:
    """Returns observations (..., OBSERVATION_SIZE) and the robot, (..., SIZE)."""
    one_hot = np.array([name == robot for name in ROBOTS], dtype=np.float32)
    columns = np.broadcast_to(one_hot, (*observations.shape[:-1], len(ROBOTS)))
    return np.concatenate((observations, columns), axis=-1)


def mirror(observations: Any) -> Any:
    """Returns what the mirror image observes, (..., SIZE): it is the same robot."""
    seen = mirror_observations(observations[..., :OBSERVATION_SIZE])
    robot = observations[..., OBSERVATION_SIZE:]
    if isinstance(observations, Tensor):
        return torch.cat((seen, robot), dim=-1)
    return np.concatenate((seen, robot), axis=-1)


def widen(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Returns a checkpoint's tensors for SIZE columns, the new ones without effect."""
    wide = dict(tensors)
    for name in FIRST_LAYERS:
        width = wide[name].shape[0]
        wide[name] = torch.cat((wide[name], torch.zeros(width, len(ROBOTS))), dim=1)
    # As if both robots had been seen as often.
    share = 1 / len(ROBOTS)
    for name, value in (("mean", share), ("variance", share * (1 - share))):
        old = wide[f"normalizer/{name}"]
        new = torch.full((len(ROBOTS),), value, dtype=old.dtype)
        wide[f"normalizer/{name}"] = torch.cat((old, new))
    return wide


class SideBySide(VecEnv):
    """Environments of several robots as one; observations say which robot it is.

    Args:
        parts: by robot.
    """

    render_mode: str | None = None  # VecEnv asks for it

    def __init__(self, parts: Mapping[str, VecEnv]) -> None:
        self._parts = parts
        counts = [part.num_envs for part in parts.values()]
        self._firsts = np.cumsum(counts)[:-1]
        space = gymnasium.spaces.Box(-np.inf, np.inf, (SIZE,), np.float32)
        super().__init__(sum(counts), space, ACTION_SPACE)

    def reset(self) -> NDArray[np.float32]:
        """Returns observations, (num_envs, SIZE)."""
        parts = self._parts.items()
        seen: list[Any] = [with_robot(np.asarray(e.reset()), name) for name, e in parts]
        return np.concatenate(seen)

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Tells all what to do; their processes work at the same time."""
        own = np.split(actions, self._firsts)
        for part, rows in zip(self._parts.values(), own, strict=True):
            part.step_async(rows)

    def step_wait(self) -> Any:
        """Returns observations, rewards, dones and infos."""
        observations, rewards, dones, infos = [], [], [], []
        for name, part in self._parts.items():
            seen, reward, done, info = part.step_wait()
            observations.append(with_robot(np.asarray(seen), name))
            rewards.append(reward)
            dones.append(done)
            for each in info:
                if "terminal_observation" in each:
                    last = each["terminal_observation"]
                    each["terminal_observation"] = with_robot(last, name)
                infos.append(each)
        joined = (np.concatenate(values) for values in (observations, rewards, dones))
        return (*joined, infos)

    def close(self) -> None:
        """Ends all."""
        for part in self._parts.values():
            part.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Returns an attribute of this object, once for each environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not supported."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, **kwargs: Any) -> list[Any]:
        """Not supported."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Returns False for each environment."""
        return [False for _ in self._get_indices(indices)]


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
    learner: AdaptivePPO, robot: str, plans: Sequence[Plan], per_label: int
) -> Scores:
    """Returns by label the mean normalized return and the share of episodes lost, %.

    Args:
        learner: whose mean action is taken.
        robot: name of the robot.
        plans: of the robot; the first of each label are followed from their start.
        per_label: plans of each label.
    """
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
        seen: Any = normalizer.normalize_obs(with_robot(batch.observe(), robot))
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
        that was stopped in between), "log", the lines of the log, and "scores" by robot
        and label.
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
    return {
        "steps": learner.num_timesteps / len(robots),
        "processor_s": None if resumed else spent,
        "log": [json.loads(line) for line in text],
        "scores": {
            name: score(learner, name, plans, settings.per_label)
            for name, plans in settings.plans.items()
        },
    }


def _processor_s() -> float:
    used = [
        resource.getrusage(who)
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    ]
    return sum(each.ru_utime + each.ru_stime for each in used)


def in_training(result: dict[str, Any], robot: str, steps: int) -> str:
    """Returns the mean over the labels of what the log says at a robot's ``steps``."""
    for line in result["log"]:
        if robot in line["return"] and line["steps"] >= steps * len(line["return"]):
            return f"{np.mean(list(line['return'][robot].values())):.1f}"
    return ""


def print_tables(results: Mapping[str, dict[str, Any]]) -> None:
    """Prints a row for each policy and robot, then one for each label."""
    points = [f"{point / 1e6:.2f}M" for point in POINTS]
    print(f"| robot | policy | {' | '.join(points)} | return | least | lost, % | min |")
    print("|---|---" + "|---:" * (len(POINTS) + 4) + "|")
    for robot in ROBOTS:
        for name, result in results.items():
            scores = result["scores"][robot]
            returns = {label: each["return"] for label, each in scores.items()}
            worst = min(returns, key=lambda label: returns[label])
            lost = np.mean([each["lost"] for each in scores.values()])
            spent = result["processor_s"]
            cells = [
                robot,
                name,
                *(in_training(result, robot, point) for point in POINTS),
                f"{np.mean(list(returns.values())):.1f}",
                f"{returns[worst]:.1f} ({worst})",
                f"{lost:.1f}",
                "" if spent is None or not result["log"] else f"{spent / 60:.1f}",
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
        "both": (ROBOTS, steps, first),
        **{name: ((name,), steps, first) for name in ROBOTS},
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
