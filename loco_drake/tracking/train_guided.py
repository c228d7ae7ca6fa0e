"""Training by guided policy search, from a policy to a better one; resumable."""

import hashlib
import json
import shutil
import time
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from statistics import fmean
from threading import Event
from typing import Any

import torch

from loco_drake.common import run_folder
from loco_drake.common.determinism import single_thread
from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.common.weights import load_into
from loco_drake.control.actor import Actor
from loco_drake.control.actor_file import load_actor, read_actor, save_actor
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.models.robots import get_simulated
from loco_drake.motion.gaits import ROW_LABELS
from loco_drake.tracking.guidance import Found, find_laws
from loco_drake.tracking.guided_config import FEWEST, GuidedConfig
from loco_drake.tracking.law_learning import learn_laws
from loco_drake.tracking.laws import Laws, load_found, save_found
from loco_drake.tracking.learning_curve import PROGRESS
from loco_drake.tracking.train import POLICY, Report

NAME = "guided"
_LAWS = "laws"  # folder of the laws
_START = "start.safetensors"  # the policy to begin with
_ACTING = "acting.safetensors"  # the policy that acts while laws are found


def train_guided(
    plans: list[Plan],
    first: Path | None,
    config: GuidedConfig,
    folder: Path,
    *,
    resume: bool = False,
    options: Mapping[str, Any] | None = None,
    report: Report = lambda steps, scores: None,
    executor: Executor = LOCAL,
) -> dict[str, Any]:
    """Improves a policy: its network, or of two the one that acts near the plan.

    Laws are found where the whole policy gets to. After each round it writes the files
    of :func:`.train.train_tracker` but for TensorBoard's to ``folder``; laws are
    written there one by one, so an interruption, or being killed, loses seconds of
    finding laws or minutes of learning.

    Args:
        plans: what to follow.
        first: file of a policy to begin with, of the same robot, without a memory;
            None to resume.
        config: how to train.
        folder: for the results.
        resume: go on from the checkpoint in ``folder``.
        options: of the command, for :func:`.run_folder.open_run`.
        report: called after each round, with the returns before the laws.
        executor: where laws are found; the results do not depend on it.

    Returns:
        robot, steps (rounds), periods (control periods that were simulated to find
        laws), wall_clock_s, interrupted, scores by label, and rounds: what each one
        found and learned.

    Raises:
        InputError: see :func:`.run_folder.open_run`; or if the policy is missing, of
            another robot, or has a memory.
        ChildProcessError: if workers die several times at the same stretch.
    """
    config.check()
    robot = get_simulated(config.environment.robot)
    path = first or Path(folder) / _START
    policy, learner = load_actor(path, robot), read_actor(path)[1]
    policy.requires_grad_(False)
    if policy.config.history is not None:
        raise InputError(f"The policy in {path} has a memory, and learns no laws.")
    if config.learns == "far" and policy.config.recovery is None:
        raise InputError(
            f"The policy in {path} has no second network, far from the plan."
        )
    shortest = FEWEST + config.stretch.tail + 2
    if max(map(len, plans)) < shortest:
        raise InputError(
            f"No motion has the {shortest} samples of {PLAN_DT:g} s that a law takes."
        )
    own = run_folder.options_of(config)
    own = {field.name: own[field.name] for field in fields(GuidedConfig)}
    run = {
        **run_folder.settings(own, "steps", "workers"),
        "references": f"{len(plans)} motions of {sum(map(len, plans))} samples",
        "first_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
    }
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
        run_folder.stop_requests() as stop,
    ):
        rounds: list[dict[str, Any]] = []
        if held.saved is not None:
            rounds = list(held.saved.state["rounds"])
            load_into(policy, run_folder.networks(held.saved), held.path)
        else:
            shutil.rmtree(Path(folder) / _LAWS, ignore_errors=True)
            with atomic_path(Path(folder) / _START) as temporary:
                shutil.copyfile(path, temporary)
            held.save(_tensors(policy), {"steps": 0, "rounds": []})
        before: dict[str, float] = {}
        laws = Laws(robot, plans, config.capacity)
        for past, line in enumerate(rounds):
            files = _files(_of_round(folder, past))
            if len(files) != line["train/laws"]:
                raise InputError(
                    f"{_of_round(folder, past)} has {len(files)} laws, not the "
                    f"{line['train/laws']} of the run: it cannot be resumed."
                )
            for file in files:
                laws.add(load_found(file))
        seconds_before = rounds[-1]["seconds"] if rounds else 0.0
        while len(rounds) < config.steps and not stop.is_set():
            number = len(rounds)
            save_actor(policy, folder / _ACTING)
            found = _find(plans, config, folder, number, executor, stop)
            if found is None:
                break
            for one in found:
                laws.add(one)
            if not len(laws):
                raise InputError(
                    "No law was found: the policy loses every stretch at once, or no "
                    "actions are better; begin with another policy, in another folder."
                )
            loss = learn_laws(policy, laws, plans, config, number)
            seconds = seconds_before + time.monotonic() - start
            periods = rounds[-1]["steps"] if rounds else 0
            periods += sum(one.periods for one in found)
            line = {"round": number + 1, "steps": periods, "seconds": seconds}
            line["train/loss"] = loss
            before, after = _returns(plans, found)
            line["train/laws"] = len(found)
            line |= {f"return/{label}": x for label, x in before.items()}
            line |= {f"improved/{label}": x for label, x in after.items()}
            rounds.append(line)
            # The checkpoint last: what it says is done is there.
            save_actor(policy, folder / POLICY, learner=learner)
            with atomic_path(folder / PROGRESS) as temporary:
                temporary.write_text("".join(json.dumps(x) + "\n" for x in rounds))
            held.save(_tensors(policy), {"steps": len(rounds), "rounds": rounds})
            if before:
                report(len(rounds), before)
    return {
        "robot": robot.name,
        "steps": len(rounds),
        "periods": rounds[-1]["steps"] if rounds else 0,
        "wall_clock_s": time.monotonic() - start,
        "interrupted": len(rounds) < config.steps,
        "saved": True,
        "scores": before,
        "rounds": rounds,
    }


def _of_round(folder: Path, number: int) -> Path:
    return Path(folder) / _LAWS / f"{number + 1:03d}"


def _files(folder: Path) -> list[Path]:
    """Returns the files of a round's laws; not what is half-written."""
    return sorted(folder.glob("[0-9]*.safetensors"))


def _tensors(policy: Actor) -> dict[str, torch.Tensor]:
    return {f"module/{name}": value for name, value in policy.state_dict().items()}


def _find(
    plans: list[Plan],
    config: GuidedConfig,
    folder: Path,
    number: int,
    executor: Executor,
    stop: Event,
) -> list[Found] | None:
    """Finds the laws of a round that are not found yet; None if it is stopped."""
    into = _of_round(folder, number)
    into.mkdir(parents=True, exist_ok=True)
    for unfinished in into.glob(".*"):
        unfinished.unlink()  # left by a training that was killed
    paths = [into / f"{i:05d}.safetensors" for i in range(config.stretches)]
    missing = [i for i, path in enumerate(paths) if not path.is_file()]
    seeds = [(config.seed, number, i) for i in missing]
    acting = folder / _ACTING
    found = find_laws(
        plans, acting, config.environment, config.stretch, seeds, executor
    )
    for i, one in zip(missing, found, strict=True):
        if one is not None:
            save_found(paths[i], one)
        if stop.is_set():
            return None
    # As they are stored, whether or not the training was interrupted.
    return [load_found(path) for path in _files(into)]


def _returns(
    plans: list[Plan], found: list[Found]
) -> tuple[dict[str, float], dict[str, float]]:
    """Returns normalized returns by label, 0-100: before the laws, and with them."""
    before: dict[str, list[float]] = {}
    after: dict[str, list[float]] = {}
    for one in found:
        label = str(ROW_LABELS[int(plans[one.plan].labels[0])])
        before.setdefault(label, []).append(100 * one.before)
        after.setdefault(label, []).append(100 * one.law.reward)
    means = [{x: fmean(of[x]) for x in sorted(of)} for of in (before, after)]
    return means[0], means[1]
