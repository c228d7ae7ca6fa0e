"""Training of the tracking policy: from plans to weights, resumable at any moment."""

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from torch import Tensor

from loco_drake.common.errors import InputError
from loco_drake.control.actor import ActorConfig, save_actor
from loco_drake.control.observation import OBSERVATION_LAYOUT, OBSERVATION_SIZE
from loco_drake.control.plan import Plan
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import ROW_LABELS
from loco_drake.tracking.checkpoint import (
    load_checkpoint,
    restore,
    save_checkpoint,
    start_from,
)
from loco_drake.tracking.environment_config import EnvironmentConfig
from loco_drake.tracking.learning_curve import PROGRESS, learning_curve
from loco_drake.tracking.ppo import AdaptivePPO, PpoConfig, export_actor, make_ppo
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.workers import WorkerVecEnv

CHECKPOINT = "checkpoint.safetensors"
POLICY = "policy.safetensors"

_LAYOUT = [list(part) for part in OBSERVATION_LAYOUT]


@dataclass(kw_only=True)
class TrainingConfig:
    """How to train a tracker.

    Attributes:
        steps: environment steps in all, those before a resume included.
        workers: processes that simulate.
        per_worker: environments in each.
        seed: of everything random.
        environment: what is simulated.
        ppo: how is learned.
    """

    steps: int = 2_000_000
    workers: int = 2
    per_worker: int = 8
    seed: int = 0
    environment: EnvironmentConfig = field(default_factory=EnvironmentConfig)
    ppo: PpoConfig = field(default_factory=PpoConfig)


@dataclass(frozen=True)
class Progress:
    """What is told after each batch.

    Attributes:
        steps: environment steps so far.
        total: environment steps in all.
        scores: mean normalized return of recent training episodes by label, 0-100.
    """

    steps: int
    total: int
    scores: dict[str, float]


def train_tracker(
    plans: list[Plan],
    config: TrainingConfig,
    folder: Path,
    *,
    resume: bool = False,
    first: Path | None = None,
    report: Callable[[Progress], None] = lambda progress: None,
) -> dict[str, Any]:
    """Trains a policy to follow ``plans``.

    Writes to ``folder`` after each batch: ``checkpoint.safetensors``, with which
    training can be resumed, ``policy.safetensors``, which the diagram loads,
    ``progress.jsonl`` and TensorBoard logs. An interruption (Ctrl-C), or being killed,
    loses at most the batch being collected.

    Args:
        plans: what to follow.
        config: how to train.
        folder: for the results.
        resume: go on from the checkpoint in ``folder``.
        first: a checkpoint of any training, whose networks and normalizer are those to
            begin with; all else begins anew.
        report: called after each batch.

    Returns:
        steps, wall_clock_s of this run, interrupted, the scores by label, the robot,
        and the learning curve of all runs (:mod:`.learning_curve`).

    Raises:
        InputError: if there is nothing to resume or to begin with, or what there is was
            trained with other networks or observations, or, to resume, for another
            robot.
        ChildProcessError: if a worker process is killed.
    """
    folder = Path(folder)
    fixed = {
        "robot": config.environment.robot,
        "hidden": config.ppo.hidden,
        "privileged": config.ppo.privileged,
    }
    world = config.environment
    world.randomization.check(get_robot(world.robot), world.plant)
    if resume and first is not None:
        raise InputError("Give either a checkpoint to start from or resume, not both.")
    tensors, saved = None, None
    beginning: tuple[dict[str, Tensor], dict[str, Any]] | None = None
    if resume:
        tensors, saved = _load(folder / CHECKPOINT, fixed)
    if first is not None:
        beginning = _load(first, {"hidden": config.ppo.hidden})
    folder.mkdir(parents=True, exist_ok=True)
    for unfinished in folder.glob(".*.safetensors"):
        unfinished.unlink()  # what a training was writing when it was killed

    start = time.monotonic()
    steps_before = 0 if saved is None else int(saved["steps"])
    sampler = PlanSampler(plans, config.seed)
    environment = WorkerVecEnv(
        plans,
        config.environment,
        sampler,
        workers=config.workers,
        per_worker=config.per_worker,
        # Episodes after a resume are new ones.
        seed=config.seed + steps_before,
    )
    try:
        learner = make_ppo(environment, config.ppo, config.seed)
        if tensors is not None and saved is not None:
            restore(learner, sampler, tensors, saved)
        if beginning is not None:
            start_from(learner, *beginning)
        learner.set_logger(Logger(None, [TensorBoardOutputFormat(str(folder))]))
        saver = _Saver(folder, sampler, config, fixed, report)
        interrupted = False
        try:
            if learner.num_timesteps < config.steps:
                learner.learn(
                    config.steps - learner.num_timesteps,
                    callback=saver,
                    reset_num_timesteps=False,
                )
        except KeyboardInterrupt:
            interrupted = True
        saver.save(learner)
    finally:
        environment.close()
    log = folder / PROGRESS
    return {
        "robot": config.environment.robot,
        "steps": learner.num_timesteps,
        "wall_clock_s": time.monotonic() - start,
        "interrupted": interrupted,
        "scores": sampler.score_by_label(),
        "learning": learning_curve(log) if log.is_file() else None,
    }


def _load(
    checkpoint: Path, fixed: dict[str, Any]
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Returns tensors and state of a checkpoint that agrees with what is ``fixed``."""
    tensors, header = load_checkpoint(checkpoint)
    own = {"privileged": True, **header["config"]["fixed"]}
    own = {name: own[name] for name in fixed}
    if own != fixed:
        raise InputError(f"{checkpoint} is of {own}, not of {fixed}.")
    layout = header["config"].get("observation_layout", _LAYOUT)
    if layout != _LAYOUT or len(tensors["normalizer/mean"]) != OBSERVATION_SIZE:
        raise InputError(f"{checkpoint} is of another observation layout.")
    return tensors, header["state"]


class _Saver(BaseCallback):
    """Saves and reports after each update."""

    def __init__(
        self,
        folder: Path,
        sampler: PlanSampler,
        config: TrainingConfig,
        fixed: dict[str, Any],
        report: Callable[[Progress], None],
    ) -> None:
        super().__init__()
        self._folder = folder
        self._sampler = sampler
        self._config = config
        self._fixed = fixed
        self._report = report
        self._first = True
        self._start = time.monotonic()

    @property
    def _learner(self) -> AdaptivePPO:
        assert isinstance(self.model, AdaptivePPO)
        return self.model

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        # The update for the last batch has just been done.
        if self._first:
            self._first = False
            return
        scores = self._sampler.score_by_label()
        for label, score in scores.items():
            self.logger.record(f"return/{label}", score)
        self.logger.record("train/std", float(_std(self._learner)))
        episodes = self._learner.ep_info_buffer
        if episodes:
            lengths = [episode["l"] for episode in episodes]
            self.logger.record("return/episode_steps", float(np.mean(lengths)))
        logged = {
            name: value
            for name, value in self.logger.name_to_value.items()
            if isinstance(value, int | float | np.floating)
        }
        self.logger.dump(self.num_timesteps)
        with (self._folder / PROGRESS).open("a") as log:
            line = {
                "steps": self.num_timesteps,
                "seconds": time.monotonic() - self._start,
                **{name: float(value) for name, value in logged.items()},
            }
            log.write(json.dumps(line) + "\n")
        self.save(self._learner)
        self._report(Progress(self.num_timesteps, self._config.steps, scores))

    def save(self, learner: AdaptivePPO) -> None:
        """Writes the checkpoint and the policy."""
        save_checkpoint(
            self._folder / CHECKPOINT,
            learner,
            self._sampler,
            {
                "fixed": self._fixed,
                "observation_layout": _LAYOUT,
                "training": asdict(self._config),
            },
        )
        labels = [str(ROW_LABELS[i]) for i in self._sampler.present]
        actor_config = ActorConfig(
            robot=self._config.environment.robot,
            labels=labels,
            hidden=self._config.ppo.hidden,
            privileged=self._config.ppo.privileged,
        )
        save_actor(export_actor(learner, actor_config), self._folder / POLICY)


def _std(learner: AdaptivePPO) -> float:
    with torch.no_grad():
        return float(learner.policy.log_std.exp().mean())
