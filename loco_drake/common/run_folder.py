"""Run folders of trainings: exclusive, never overwritten, resumable."""

import fcntl
import json
import os
import signal
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from loco_drake.common.errors import InputError
from loco_drake.common.typed import convert
from loco_drake.common.weights import load_into, load_weights, save_weights

CHECKPOINT = "checkpoint.safetensors"

# Scores of plans that have not been drawn yet are NaN.
_MAY_BE_NAN = ("sampler/plan_scores", "sampler/plan_shares")
Config = TypeVar("Config")


@dataclass(frozen=True)
class Checkpoint:
    """The content of a checkpoint."""

    path: Path  # of the file
    tensors: dict[str, Tensor]  # networks, optimizer, random states
    state: dict[str, Any]  # further state of the training; "steps" are those done
    run: dict[str, Any]  # options and data that the training depends on, by name
    options: dict[str, Any]  # options of the command, as nested JSON


def read_checkpoint(path: Path, name: str) -> Checkpoint:
    """Reads a checkpoint of the training ``name``: "tracker", "tokenizer", ...

    Raises:
        InputError: if the file is missing, damaged, or of another training.
    """
    tensors, header = load_weights(path, f"{name} checkpoint", _MAY_BE_NAN)
    if "config" in header:  # format of earlier trackers
        options = header["config"]["training"]
        environment = options["environment"]
        environment["position_penalty"] = environment.pop("homing", 0.0)
        run = settings(options, "steps")
        run["observation_layout"] = header["config"].get("observation_layout")
        header = {"state": header["state"], "run": run, "options": options}
    with sound(path):
        return Checkpoint(
            path,
            tensors,
            {**header["state"], "steps": int(header["state"]["steps"])},
            dict(header["run"]),
            dict(header["options"]),
        )


@dataclass(frozen=True)
class RunFolder:
    """A folder locked by one training."""

    path: Path  # of the checkpoint
    kind: str  # of the checkpoint
    header: dict[str, Any]  # "run" and "options", see Checkpoint
    saved: Checkpoint | None  # to continue from, None at the start

    def save(self, tensors: dict[str, Tensor], state: dict[str, Any]) -> None:
        """Replaces the checkpoint; see :class:`Checkpoint`."""
        save_weights(self.path, self.kind, tensors, {**self.header, "state": state})


@contextmanager
def open_run(
    folder: Path,
    name: str,
    weights: str,
    run: Mapping[str, Any],
    *,
    steps: int,
    resume: bool,
    options: Mapping[str, Any],
) -> Iterator[RunFolder]:
    """Locks a folder for one training.

    Args:
        folder: created if it does not exist.
        name: name of the training: "tracker", "tokenizer", ...
        weights: name of the weights file that the training writes.
        run: options and data that the training depends on, as JSON by name.
        steps: total steps.
        resume: whether to continue from the checkpoint in the folder.
        options: see :class:`Checkpoint`.

    Raises:
        InputError: if another process trains in the folder; if it contains a run and
            ``resume`` is not set; or if ``resume`` is set and there is no checkpoint,
            it is damaged, or it does not match ``run``.
    """
    check_folder(folder, weights, resume)
    with locked(folder):
        check_folder(folder, weights, resume)
        saved = read_checkpoint(folder / CHECKPOINT, name) if resume else None
        if saved is not None:
            check_same(saved, run, settings(options), steps)
        for unfinished in folder.glob(".*.safetensors"):
            unfinished.unlink()  # left by a training that was killed
        header = {"run": dict(run), "options": dict(options)}
        yield RunFolder(folder / CHECKPOINT, f"{name} checkpoint", header, saved)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Holds the lock of a folder, which is created if it does not exist.

    Raises:
        InputError: if another process holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            # The system releases the lock when the process ends, for any reason.
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"Another training is at work in {str(folder)!r}; stop it first, or "
                "name another folder with --out."
            ) from None
        yield
    finally:
        os.close(handle)


def is_locked(folder: Path) -> bool:
    """Returns whether a process holds the lock of a folder, see :func:`locked`."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


def check_folder(folder: Path, weights: str, resume: bool) -> None:
    """Raises InputError if a training cannot start, or resume, in ``folder``."""
    found = [file for file in (CHECKPOINT, weights) if (folder / file).exists()]
    if resume and CHECKPOINT not in found:
        raise InputError(
            f"There is no run to resume in {str(folder)!r}, which has no {CHECKPOINT}; "
            "to begin one, leave out --resume."
        )
    if found and not resume:
        raise InputError(
            f"{str(folder)!r} holds a run already ({', '.join(found)}); resume it "
            "with --resume, or name another folder with --out."
        )


def check_same(
    saved: Checkpoint, run: Mapping[str, Any], options: Iterable[str], steps: int
) -> None:
    """Raises InputError unless a checkpoint matches ``run``, see :func:`open_run`.

    Names that the checkpoint lacks are not compared; ``options`` are names of options.
    """
    folder = str(saved.path.parent)
    differ = [name for name in run if saved.run.get(name, run[name]) != run[name]]
    if differ:
        # Name options rather than what follows from them.
        named = {x: f"--{x.replace('_', '-')}" for x in differ if x in options}
        names = named or {name: name for name in differ}
        values = [f"{y} {saved.run[x]}, not {run[x]}" for x, y in names.items()]
        raise InputError(
            f"The run in {folder!r} has {', and '.join(values)}; resume it as it is, "
            "or train anew in another folder with --out."
        )
    if steps < saved.state["steps"]:
        raise InputError(
            f"The run in {folder!r} has done {saved.state['steps']} steps, more than "
            f"--steps {steps}."
        )


def settings(options: Mapping[str, Any], *without: str) -> dict[str, Any]:
    """Returns nested options under their names on the command line.

    The parts "environment" and "ppo" have no prefix there.
    """
    flat: dict[str, Any] = {}
    for name, value in options.items():
        if isinstance(value, Mapping):
            prefix = "" if name in ("environment", "ppo") else f"{name}."
            flat |= {f"{prefix}{key}": inner for key, inner in settings(value).items()}
        elif name not in without:
            flat[name] = list(value) if isinstance(value, tuple) else value
    return flat


def options_of(config: Any) -> dict[str, Any]:
    """Returns a dataclass as nested JSON; paths and infinity are text."""
    text = json.dumps(asdict(config), default=str)
    options: dict[str, Any] = json.loads(text, parse_constant=str)
    return options


def with_options(config: Config, options: Mapping[str, Any]) -> Config:
    """Returns a copy of a dataclass with values from :func:`options_of`.

    Fields that ``options`` lacks keep their value; unknown options are ignored.

    Raises:
        FieldError: if a value is not of the field's type.
    """

    def updated(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
        values = {**old, **{name: new[name] for name in old if name in new}}
        for name, value in old.items():
            if isinstance(value, dict) and isinstance(values[name], dict):
                values[name] = updated(value, values[name])
        return values

    values = updated(options_of(config), options)
    return convert(values, type(config), numeric_text=True)


def learning_tensors(
    module: nn.Module, optimizer: torch.optim.Optimizer
) -> dict[str, Tensor]:
    """Returns networks, optimizer and torch's random state for a checkpoint.

    They are on the CPU, wherever the module is.
    """
    tensors = {f"module/{name}": value for name, value in module.state_dict().items()}
    for index, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer/{index}/{name}": x for name, x in moments.items()}
    tensors = {name: value.cpu() for name, value in tensors.items()}
    device = next(module.parameters()).device
    if device.type == "cuda":
        tensors["random/cuda"] = torch.cuda.get_rng_state(device)
    return {**tensors, "random/torch": torch.get_rng_state()}


def restore_learning(
    saved: Checkpoint, module: nn.Module, optimizer: torch.optim.Optimizer
) -> None:
    """Restores what :func:`learning_tensors` returned.

    Raises:
        InputError: if the tensors do not fit.
    """
    load_into(module, networks(saved), saved.path)
    with sound(saved.path):
        moments: dict[int, dict[str, Tensor]] = {}
        for key, value in part(saved, "optimizer").items():
            number, name = key.split("/")
            moments.setdefault(int(number), {})[name] = value
        # The optimizer itself would take whatever it is given.
        weights = [w for group in optimizer.param_groups for w in group["params"]]
        for index, of in moments.items():
            shapes = {name: value.shape for name, value in of.items()}
            shape = weights[index].shape
            if shapes != {"step": (), "exp_avg": shape, "exp_avg_sq": shape} or not all(
                value.is_floating_point() for value in of.values()
            ):
                raise ValueError("not the moments of Adam")
        groups = optimizer.state_dict()["param_groups"]
        optimizer.load_state_dict({"state": moments, "param_groups": groups})
        torch.set_rng_state(saved.tensors["random/torch"])
        device = next(module.parameters()).device
        if device.type == "cuda" and "random/cuda" in saved.tensors:
            torch.cuda.set_rng_state(saved.tensors["random/cuda"], device)


def networks(saved: Checkpoint) -> dict[str, Tensor]:
    """Returns the state dict of a checkpoint's networks."""
    # Earlier trackers used the prefix "policy".
    return part(saved, "module") or part(saved, "policy")


def part(saved: Checkpoint, name: str) -> dict[str, Tensor]:
    """Returns the tensors of a checkpoint with the prefix ``name/``, without it."""
    prefix = f"{name}/"
    return {
        key.removeprefix(prefix): value
        for key, value in saved.tensors.items()
        if key.startswith(prefix)
    }


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Converts exceptions from unusable checkpoint content to InputError."""
    try:
        yield
    except InputError:
        raise
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        TypeError,
        ValueError,
        RuntimeError,
    ):
        raise InputError(
            f"{path} is damaged, or does not fit the network of this run."
        ) from None


@contextmanager
def stop_requests() -> Iterator[threading.Event]:
    """Yields an event that Ctrl-C and SIGTERM set; a second signal interrupts."""
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
