"""Training of the tracking policy, from plans to weights; resumable at any time."""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from torch import Tensor

from loco_drake.common import run_folder
from loco_drake.common.determinism import single_thread
from loco_drake.common.device import find_device
from loco_drake.common.errors import InputError
from loco_drake.common.run_folder import Checkpoint, RunFolder
from loco_drake.control.actor import Actor, ActorConfig, config_for
from loco_drake.control.observation import layout_of
from loco_drake.control.plan import Plan
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.models.robots import get_simulated
from loco_drake.motion.gaits import ROW_LABELS
from loco_drake.tracking.beginning import (
    NAME,
    keep_recovery,
    of_checkpoint,
    read_beginning,
    save_policy,
)
from loco_drake.tracking.config import TrainingConfig
from loco_drake.tracking.learning_curve import PROGRESS, learning_curve, trim_log
from loco_drake.tracking.ppo import AdaptivePPO, make_ppo
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.workers import WorkerVecEnv

POLICY = "policy.safetensors"

# Is told the environment steps so far, and the mean normalized return of recent
# training episodes by label, 0-100.
Report = Callable[[int, dict[str, float]], None]


def train_tracker(
    plans: list[Plan],
    config: TrainingConfig,
    folder: Path,
    *,
    resume: bool = False,
    first: Path | None = None,
    options: Mapping[str, Any] | None = None,
    report: Report = lambda steps, scores: None,
    executor: Executor = LOCAL,
    device: str = "cpu",
) -> dict[str, Any]:
    """Trains a policy to track ``plans``.

    After each batch it writes ``checkpoint.safetensors``, from which training can
    resume, ``policy.safetensors``, which the diagram loads, ``progress.jsonl`` and
    TensorBoard logs to ``folder``. An interruption (Ctrl-C), or being killed, loses at
    most the current batch; a worker that dies is replaced, and costs nothing.

    Args:
        plans: what to follow.
        config: how to train.
        folder: for the results.
        resume: go on from the checkpoint in ``folder``.
        first: a checkpoint or policy of any training, whose networks, normalizer and
            learning rate are those to begin with; all else begins anew.
        options: of the command, for :func:`.run_folder.open_run`.
        report: called after each batch.
        executor: where the workers run; the results do not depend on it.
        device: where the updates are computed, see :func:`.find_device`.

    Returns:
        steps, wall_clock_s of this run, interrupted, the scores by label, the robot,
        and the learning curve of all runs (:mod:`.learning_curve`).

    Raises:
        InputError: see :func:`.run_folder.open_run`; or if there is nothing to begin
            with, it has other networks or observations, or there is no such device.
        ChildProcessError: if workers die several times at the same step.
    """
    config.check()
    if resume and first is not None:
        raise InputError("Give either a checkpoint to start from or resume, not both.")
    robot = get_simulated(config.environment.robot)
    layout = layout_of(robot)
    own = run_folder.options_of(config)
    own = {field.name: own[field.name] for field in fields(TrainingConfig)}
    run = {
        # Not how many processes share the environments: results are the same.
        **run_folder.settings(own, "steps", "workers", "per_worker"),
        "environments": config.workers * config.per_worker,
        "references": f"{len(plans)} motions of {sum(map(len, plans))} samples",
        "observation_layout": list(layout.record),
    }
    learns_on = find_device(device)
    beginning = (
        None if first is None else read_beginning(first, config.ppo.hidden, layout)
    )
    sampler = PlanSampler(
        plans,
        config.seed,
        failure_weight=config.environment.failure_weight,
        half_episode=config.environment.episode_steps // 2,
    )
    actor = config_for(
        robot,
        labels=[str(ROW_LABELS[i]) for i in sampler.present],
        hidden=config.ppo.hidden,
        privileged=config.ppo.privileged,
    )
    start = time.monotonic()
    with (
        single_thread(),
        run_folder.open_run(
            Path(folder),
            NAME,
            POLICY,
            run,
            steps=config.steps,
            resume=resume,
            options=options or own,
        ) as held,
    ):
        steps_before = held.saved.state["steps"] if held.saved else 0
        log = Path(folder) / PROGRESS
        trim_log(log, steps_before, config.ppo.batch)
        environment = WorkerVecEnv(
            plans,
            config.environment.known_to(privileged=config.ppo.privileged),
            sampler,
            workers=config.workers,
            per_worker=config.per_worker,
            # Returns are then between 0 and 1.
            reward_scale=1 - config.ppo.gamma,
            # Episodes after a resume are new ones.
            seed=config.seed + steps_before,
            executor=executor,
        )
        try:
            learner = make_ppo(environment, config.ppo, config.seed, learns_on, layout)
            if beginning is not None:
                beginning.load(learner)
                if config.ppo.restart_log_std is not None:
                    learner.policy.log_std.data.fill_(config.ppo.restart_log_std)
            if held.saved is not None:
                _restore(learner, sampler, held.saved)
            writer = TensorBoardOutputFormat(str(folder))
            learner.set_logger(Logger(None, [writer]))
            with run_folder.stop_requests() as stop_requested:
                saver = _Saver(
                    held,
                    log,
                    sampler,
                    actor,
                    keep_recovery(Path(folder), beginning, actor),
                    report,
                    stop_requested,
                    steps_before,
                )
                if learner.num_timesteps < config.steps:
                    learner.learn(
                        config.steps - learner.num_timesteps,
                        callback=saver,
                        reset_num_timesteps=False,
                    )
            interrupted = learner.num_timesteps < config.steps
            if not interrupted:
                saver.save(learner)
        finally:
            environment.close()
    return {
        "robot": robot.name,
        "steps": saver.saved_steps,
        "wall_clock_s": time.monotonic() - start,
        "interrupted": interrupted,
        "scores": sampler.score_by_label(),
        "learning": learning_curve(log) if log.is_file() else None,
    }


def _state(
    learner: AdaptivePPO, sampler: PlanSampler
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Returns what :func:`_restore` needs, as :meth:`.RunFolder.save` takes it."""
    statistics = learner.statistics
    # stable-baselines3 shuffles its minibatches with numpy's global generator.
    _, keys, position, has_gauss, gauss = np.random.get_state()  # noqa: NPY002
    tensors = run_folder.learning_tensors(learner.policy, learner.policy.optimizer)
    tensors["normalizer/mean"] = torch.from_numpy(statistics.mean)
    tensors["normalizer/variance"] = torch.from_numpy(statistics.var)
    tensors["random/numpy"] = torch.from_numpy(np.asarray(keys).astype(np.int64))
    return tensors | sampler.tensors(), {
        "steps": learner.num_timesteps,
        "learning_rate": learner.rate,
        "normalizer_count": float(statistics.count),
        "sampler_random": sampler.random.bit_generator.state,
        "numpy_random": [int(position), int(has_gauss), float(gauss)],
    }


def _restore(learner: AdaptivePPO, sampler: PlanSampler, saved: Checkpoint) -> None:
    """Restores ``learner`` and ``sampler`` from the checkpoint."""
    of_checkpoint(saved).load(learner)
    run_folder.restore_learning(saved, learner.policy, learner.policy.optimizer)
    with run_folder.sound(saved.path):
        sampler.restore(saved)
        position, has_gauss, gauss = saved.state["numpy_random"]
        keys = saved.tensors["random/numpy"].numpy().astype(np.uint32)
        np.random.set_state(("MT19937", keys, position, has_gauss, gauss))  # noqa: NPY002
        learner.num_timesteps = saved.state["steps"]


@dataclass(eq=False)
class _Saver(BaseCallback):
    """Saves and reports after each update, and stops on request."""

    run: RunFolder
    log: Path
    sampler: PlanSampler
    actor: ActorConfig
    recovery: Actor | None
    report: Report
    stop_requested: Event
    saved_steps: int

    def __post_init__(self) -> None:
        super().__init__()
        self.start = time.monotonic()

    def _on_step(self) -> bool:
        return not self.stop_requested.is_set()

    def _on_rollout_start(self) -> None:
        if self.num_timesteps == self.saved_steps:
            return
        # The update for the last batch has just been done.
        assert isinstance(self.model, AdaptivePPO)
        scores = self.sampler.score_by_label()
        for label, score in scores.items():
            self.logger.record(f"return/{label}", score)
        episodes = self.model.ep_info_buffer
        if episodes:
            lengths = [episode["l"] for episode in episodes]
            self.logger.record("return/episode_steps", float(np.mean(lengths)))
        line = {"steps": self.num_timesteps, "seconds": time.monotonic() - self.start}
        for name, value in self.logger.name_to_value.items():
            line[name] = float(value)
        self.logger.dump(self.num_timesteps)
        with self.log.open("a") as log:
            log.write(json.dumps(line) + "\n")
        self.save(self.model)
        self.report(self.num_timesteps, scores)

    def save(self, learner: AdaptivePPO) -> None:
        """Writes the checkpoint and the policy."""
        self.run.save(*_state(learner, self.sampler))
        self.saved_steps = learner.num_timesteps
        save_policy(learner, self.actor, self.log.parent / POLICY, self.recovery)
