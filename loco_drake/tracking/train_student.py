"""Training of a student, from a teacher and plans to weights; resumable at any time."""

import hashlib
import json
import math
import time
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from statistics import fmean
from typing import Any

import torch
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from loco_drake.common import run_folder
from loco_drake.common.determinism import single_thread
from loco_drake.common.errors import InputError
from loco_drake.common.run_folder import Checkpoint
from loco_drake.control.actor_file import load_actor, save_actor
from loco_drake.control.observation import LAYOUT
from loco_drake.control.plan import Plan
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import ROW_LABELS
from loco_drake.tracking.config import StudentConfig
from loco_drake.tracking.learning_curve import PROGRESS, learning_curve, trim_log
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.student import Dagger, make_student
from loco_drake.tracking.train import POLICY, Report
from loco_drake.tracking.workers import WorkerVecEnv

NAME = "student"


def train_student(
    plans: list[Plan],
    teacher: Path,
    config: StudentConfig,
    folder: Path,
    *,
    resume: bool = False,
    options: Mapping[str, Any] | None = None,
    report: Report = lambda steps, scores: None,
) -> dict[str, Any]:
    """Trains a policy without privileged observations to act as a teacher does.

    After each batch it writes the files of :func:`.train.train_tracker` to ``folder``,
    and stops and resumes as that does. A resumed training collects its samples anew.

    Args:
        plans: what to follow.
        teacher: file of a policy with privileged observations, of the same robot.
        config: how to train.
        folder: for the results.
        resume: go on from the checkpoint in ``folder``.
        options: of the command, for :func:`.run_folder.open_run`.
        report: called after each batch.

    Returns:
        As :func:`.train.train_tracker`.

    Raises:
        InputError: see :func:`.run_folder.open_run`; or if the teacher is missing,
            of another robot, or lacks privileged observations itself.
        ChildProcessError: if workers die several times at the same step.
    """
    config.check()
    actor = load_actor(teacher, get_robot(config.environment.robot))
    if not actor.config.privileged:
        raise InputError(
            f"The policy in {teacher} cannot teach: it has no privileged observations."
        )
    actor.requires_grad_(False)
    own = run_folder.options_of(config)
    own = {field.name: own[field.name] for field in fields(StudentConfig)}
    run = {
        **run_folder.settings(own, "steps"),
        "references": f"{len(plans)} motions of {sum(map(len, plans))} samples",
        "observation_layout": list(LAYOUT.record),
        "teacher_sha256": hashlib.sha256(teacher.read_bytes()).hexdigest(),
    }
    sampler = PlanSampler(plans, config.seed)
    labels = [str(ROW_LABELS[i]) for i in sampler.present]
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
        steps = held.saved.state["steps"] if held.saved else 0
        log = Path(folder) / PROGRESS
        robots = config.workers * config.per_worker
        samples = config.batch // robots * robots  # of a batch
        trim_log(log, steps, samples)
        torch.manual_seed(config.seed)
        student = make_student(actor, config.history, labels)
        learner = Dagger(student, actor, config)
        if held.saved is not None:
            _restore(learner, sampler, held.saved)
        environment = WorkerVecEnv(
            plans,
            config.environment.known_to(privileged=False),
            sampler,
            workers=config.workers,
            per_worker=config.per_worker,
            # Episodes after a resume are new ones.
            seed=config.seed + steps,
            exact=True,
        )
        writer = Logger(None, [TensorBoardOutputFormat(str(folder))])
        try:
            learner.begin(environment)
            with run_folder.stop_requests() as stop_requested:
                while steps < config.steps and not stop_requested.is_set():
                    done = steps / config.steps
                    episodes = learner.collect(environment, _share(config, done))
                    errors = learner.learn(_rate(config, done))
                    steps += samples
                    scores = sampler.score_by_label()
                    line = {
                        "steps": steps,
                        "seconds": time.monotonic() - start,
                        **{f"train/{k}_error": x for k, x in asdict(errors).items()},
                        "train/learning_rate": _rate(config, done),
                        "train/teacher_share": _share(config, done),
                        **{f"return/{label}": x for label, x in scores.items()},
                    }
                    if episodes:
                        lengths = fmean(episode["l"] for episode in episodes)
                        line["return/episode_steps"] = lengths
                    for name, value in line.items():
                        writer.record(name, value)
                    writer.dump(steps)
                    with log.open("a") as file:
                        file.write(json.dumps(line) + "\n")
                    held.save(*_state(learner, sampler, steps))
                    save_actor(learner.student, Path(folder) / POLICY)
                    report(steps, scores)
        finally:
            environment.close()
            writer.close()
    return {
        "robot": config.environment.robot,
        "steps": steps,
        "wall_clock_s": time.monotonic() - start,
        "interrupted": steps < config.steps,
        "scores": sampler.score_by_label(),
        "learning": learning_curve(log) if log.is_file() else None,
    }


def _share(config: StudentConfig, done: float) -> float:
    """Returns the teacher's share of the actions when so much has been done."""
    return max(0.0, 1 - done / config.handover) if config.handover else 0.0


def _rate(config: StudentConfig, done: float) -> float:
    """Returns the learning rate when so much has been done."""
    return config.learning_rate * (1 + math.cos(math.pi * done)) / 2


def _state(
    learner: Dagger, sampler: PlanSampler, steps: int
) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Returns what :func:`_restore` needs, as :meth:`.RunFolder.save` takes it."""
    tensors = run_folder.learning_tensors(learner.student, learner.optimizer)
    return tensors | sampler.tensors(), {
        "steps": steps,
        "sampler_random": sampler.random.bit_generator.state,
        "random": learner.random.bit_generator.state,
    }


def _restore(learner: Dagger, sampler: PlanSampler, saved: Checkpoint) -> None:
    """Restores ``learner`` and ``sampler`` from the checkpoint."""
    run_folder.restore_learning(saved, learner.student, learner.optimizer)
    with run_folder.sound(saved.path):
        sampler.restore(saved)
        learner.random.bit_generator.state = saved.state["random"]
