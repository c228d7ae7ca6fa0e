"""The training loop of a network: resumable, stoppable, logged."""

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.tensorboard import SummaryWriter

from loco_drake.common import run_folder
from loco_drake.common.determinism import single_thread
from loco_drake.common.device import find_device
from loco_drake.common.progress import progress_bar
from loco_drake.generation.loop_settings import RUN_SETTINGS, LoopSettings

# Returns the loss and figures to log for one batch, drawn with the given generator.
LossFunction = Callable[[np.random.Generator], tuple[Tensor, dict[str, float]]]


@dataclass(frozen=True)
class LoopResult:
    """Result of :func:`train`."""

    steps: int  # optimizer steps taken in all, those before a resume included
    stopped: bool  # whether it was stopped by Ctrl-C before its last step
    loss: float  # of the last batch
    seconds: float  # of this call


def train(
    name: str,
    module: nn.Module,
    loss_of_batch: LossFunction,
    config: LoopSettings,
    run: Mapping[str, Any],
) -> LoopResult:
    """Trains ``module`` in place, on the device of its settings; it is on the CPU then.

    After Ctrl-C (or SIGTERM) the current step is completed and a checkpoint saved. A
    resumed run computes what the uninterrupted run would have computed, bit for bit.

    Args:
        name: of checkpoint, weights and progress bar: "tokenizer", "generator", ...
        module: what to train.
        loss_of_batch: see :data:`LossFunction`; it computes on that device.
        config: how to train.
        run: what the run depends on besides, as JSON.

    Raises:
        InputError: see :func:`loco_drake.common.run_folder.open_run`; or if there is
            no such device.
    """
    config.check()
    device = find_device(config.device)
    module.to(device)
    start = time.perf_counter()
    run = run_folder.settings(
        {**{key: getattr(config, key) for key in RUN_SETTINGS}, **run}
    )
    run = json.loads(json.dumps(run))  # as a checkpoint gives it back
    optimizer = torch.optim.AdamW(
        module.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    random = np.random.default_rng(config.seed)
    with (
        single_thread(),
        run_folder.open_run(
            config.out,
            name,
            f"{name}.safetensors",
            run,
            steps=config.steps,
            resume=config.resume,
            options=run_folder.options_of(config),
        ) as folder,
        run_folder.stop_requests() as stop_requested,
        torch.random.fork_rng(devices=[] if device.type == "cpu" else [device]),
    ):
        torch.manual_seed(config.seed)
        step = 0

        def save() -> None:
            state = {"steps": step, "random": random.bit_generator.state}
            folder.save(run_folder.learning_tensors(module, optimizer), state)

        if (saved := folder.saved) is not None:
            run_folder.restore_learning(saved, module, optimizer)
            with run_folder.sound(saved.path):
                random.bit_generator.state = saved.state["random"]
            step = saved.state["steps"]
        module.train()
        last = math.nan
        # The logs overwrite what a lost run logged later.
        writer = SummaryWriter(str(config.out / "logs"), purge_step=step)
        with progress_bar() as progress, writer as logs:
            bar = progress.add_task(name, total=config.steps, completed=step, note="")
            while step < config.steps and not stop_requested.is_set():
                optimizer.param_groups[0]["lr"] = config.learning_rate * _schedule(
                    step / config.steps
                )
                loss, metrics = loss_of_batch(random)
                optimizer.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]
                nn.utils.clip_grad_norm_(module.parameters(), 1.0)
                optimizer.step()
                step += 1
                last = loss.item()
                progress.update(bar, completed=step, note=f"loss {last:.4f}")
                if step % config.log_every == 0:
                    for key, value in {"loss": last, **metrics}.items():
                        logs.add_scalar(key, value, step)
                if step % config.checkpoint_every == 0:
                    save()
        save()
        module.eval()
    module.cpu()
    seconds = time.perf_counter() - start
    return LoopResult(step, step < config.steps, last, seconds)


def _schedule(progress: float) -> float:
    """Returns the learning rate relative to its peak, for ``progress`` in [0, 1)."""
    return min(progress / 0.02 + 0.01, 1.0) * 0.5 * (1 + math.cos(math.pi * progress))
