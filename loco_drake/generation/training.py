"""The loop that trains both networks: resumable, stoppable, logged."""

import json
import math
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)
from torch import Tensor, nn
from torch.utils.tensorboard import SummaryWriter

from loco_drake.common.determinism import single_thread
from loco_drake.common.errors import InputError
from loco_drake.common.weights import load_into, load_weights, save_weights

# Returns the loss and figures to log for one batch, drawn with the given generator.
LossFunction = Callable[[np.random.Generator], tuple[Tensor, dict[str, float]]]

CHECKPOINT = "checkpoint.safetensors"


@dataclass(frozen=True)
class LoopSettings:
    """How to run :func:`train`.

    Attributes:
        out: folder of the checkpoint and the TensorBoard logs.
        steps: optimizer steps in all.
        learning_rate: the highest; it rises over the first 2 % of the steps and then
            falls to zero as half a cosine.
        weight_decay: of AdamW.
        seed: of the batches, and of what torch draws.
        resume: whether to go on from the checkpoint in ``out``.
        checkpoint_every: steps between checkpoints.
        log_every: steps between entries in the logs.
    """

    out: Path
    steps: int
    learning_rate: float
    weight_decay: float = 0.01
    seed: int = 0
    resume: bool = False
    checkpoint_every: int = 500
    log_every: int = 20


@dataclass(frozen=True)
class LoopResult:
    """What :func:`train` did.

    Attributes:
        steps: optimizer steps taken in all, those before a resume included.
        stopped: whether it was stopped by Ctrl-C before its last step.
        loss: of the last batch.
    """

    steps: int
    stopped: bool
    loss: float


def train(
    name: str,
    module: nn.Module,
    loss_of_batch: LossFunction,
    settings: LoopSettings,
    config: dict[str, Any],
) -> LoopResult:
    """Trains ``module`` in place.

    After Ctrl-C (or SIGTERM) the step under way is completed and a checkpoint saved.
    A run that goes on from a checkpoint computes what the uninterrupted run would
    have computed, to the last bit.

    Args:
        name: "tokenizer" or "generator": names checkpoint and progress bar.
        module: what to train.
        loss_of_batch: see :data:`LossFunction`.
        settings: see there.
        config: what the run depends on, as JSON; a checkpoint of a run with another
            config is refused.

    Raises:
        InputError: if a checkpoint is to be resumed that is not there, damaged, or
            of another run.
    """
    config = {**config, "steps": settings.steps, "seed": settings.seed}
    config = json.loads(json.dumps(config))  # as a checkpoint gives it back
    optimizer = torch.optim.AdamW(
        module.parameters(),
        lr=settings.learning_rate,
        weight_decay=settings.weight_decay,
    )
    random = np.random.default_rng(settings.seed)
    path = settings.out / CHECKPOINT
    kind = f"{name}-checkpoint"
    with (
        single_thread(),
        _stop_requests() as stop_requested,
        torch.random.fork_rng(devices=[]),
    ):
        torch.manual_seed(settings.seed)
        step = 0
        if settings.resume:
            step = _load(path, kind, module, optimizer, random, config)
        module.train()
        last = math.nan
        with _progress() as progress, _logs(settings.out, step) as logs:
            bar = progress.add_task(name, total=settings.steps, completed=step, note="")
            while step < settings.steps and not stop_requested.is_set():
                for group in optimizer.param_groups:
                    group["lr"] = settings.learning_rate * _schedule(
                        step / settings.steps
                    )
                loss, metrics = loss_of_batch(random)
                optimizer.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]
                nn.utils.clip_grad_norm_(module.parameters(), 1.0)
                optimizer.step()
                step += 1
                last = loss.item()
                progress.update(bar, completed=step, note=f"loss {last:.4f}")
                if step % settings.log_every == 0:
                    logs.add_scalar("loss", last, step)
                    for key, value in metrics.items():
                        logs.add_scalar(key, value, step)
                if step % settings.checkpoint_every == 0:
                    _save(path, kind, module, optimizer, random, config, step)
        _save(path, kind, module, optimizer, random, config, step)
        module.eval()
    return LoopResult(step, step < settings.steps, last)


def _schedule(progress: float) -> float:
    """Returns the learning rate as a share of the highest, ``progress`` in [0, 1)."""
    return min(progress / 0.02 + 0.01, 1.0) * 0.5 * (1 + math.cos(math.pi * progress))


def _save(
    path: Path,
    kind: str,
    module: nn.Module,
    optimizer: torch.optim.Optimizer,
    random: np.random.Generator,
    config: dict[str, Any],
    step: int,
) -> None:
    tensors = {f"module.{name}": t for name, t in module.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{key}": t for key, t in state.items()}
    tensors["torch_random_state"] = torch.get_rng_state()
    header = {"run": config, "step": step, "random": random.bit_generator.state}
    save_weights(path, kind, tensors, header)


def _load(
    path: Path,
    kind: str,
    module: nn.Module,
    optimizer: torch.optim.Optimizer,
    random: np.random.Generator,
    config: dict[str, Any],
) -> int:
    """Returns the steps taken, all else restored in place."""
    tensors, header = load_weights(path, kind)
    try:
        run, step, state = dict(header["run"]), int(header["step"]), header["random"]
        torch_state = tensors.pop("torch_random_state")
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path} has a damaged checkpoint header.") from None
    changed = [key for key in config | run if config.get(key) != run.get(key)]
    if changed:
        raise InputError(
            f"{path} is of a run with other settings ({', '.join(sorted(changed))}); "
            f"resume with the same ones, or train anew in another folder."
        )
    moments: dict[int, dict[str, Tensor]] = {}
    for name in [name for name in tensors if name.startswith("optimizer.")]:
        _, index, key = name.split(".")
        moments.setdefault(int(index), {})[key] = tensors.pop(name)
    load_into(module, {n.removeprefix("module."): t for n, t in tensors.items()}, path)
    try:
        groups = optimizer.state_dict()["param_groups"]
        optimizer.load_state_dict({"state": moments, "param_groups": groups})
        random.bit_generator.state = state
        torch.set_rng_state(torch_state)
    except (KeyError, TypeError, ValueError, RuntimeError):
        raise InputError(f"{path} does not fit the network it is of.") from None
    return step


@contextmanager
def _stop_requests() -> Iterator[threading.Event]:
    """Yields an event that Ctrl-C and SIGTERM set; a second Ctrl-C interrupts."""
    requested = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield requested  # only the main thread may handle signals
        return

    def handle(number: int, frame: FrameType | None) -> None:
        if requested.is_set():
            raise KeyboardInterrupt
        requested.set()

    numbers = (signal.SIGINT, signal.SIGTERM)
    previous = [signal.signal(number, handle) for number in numbers]
    try:
        yield requested
    finally:
        for number, handler in zip(numbers, previous, strict=True):
            signal.signal(number, handler)


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        refresh_per_second=2,
    )


@contextmanager
def _logs(folder: Path, step: int) -> Iterator[SummaryWriter]:
    """Yields a TensorBoard writer that overwrites what a lost run logged later."""
    writer = SummaryWriter(str(folder / "logs"), purge_step=step)
    try:
        yield writer
    finally:
        writer.close()
