"""What a training starts from: networks and statistics of an earlier one.

They come from a training's checkpoint, or from a policy file, which also holds what a
training needs beside the policy.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from loco_drake.common import run_folder
from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.run_folder import Checkpoint
from loco_drake.common.weights import kind_of, load_into
from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import KIND, read_actor, save_actor
from loco_drake.control.observation import LAYOUT, Layout
from loco_drake.tracking.joining import joined, recovery_of
from loco_drake.tracking.ppo import AdaptivePPO, actor_layers, export_actor

NAME = "tracker"
# Beside a checkpoint: what acts far from the plan, which the training leaves as it is.
RECOVERY = "recovery.safetensors"


@dataclass(frozen=True, eq=False)
class Beginning:
    """Networks, statistics of the observations and learning rate of a training."""

    path: Path  # where they were read
    networks: dict[str, Tensor]  # state dict of ppo.SymmetricPolicy
    mean: Array  # of the observations, shape (size,)
    variance: Array  # of the same shape
    count: float  # number of observations behind both
    rate: float  # learning rate of the actor
    # Acts far from the plan, with its own mean and variance; it is not trained.
    recovery: Actor | None = None

    def load(self, learner: AdaptivePPO) -> None:
        """Copies everything into ``learner``.

        Raises:
            InputError: if something does not fit.
        """
        load_into(learner.policy, self.networks, self.path)
        with run_folder.sound(self.path):
            statistics = learner.statistics
            if not self.mean.shape == self.variance.shape == statistics.mean.shape:
                raise ValueError("statistics of another size")
            if self.variance.min() < 0 or self.count <= 0 or not 0 < self.rate <= 1:
                raise ValueError("numbers that no training has")
            statistics.mean, statistics.var = self.mean, self.variance
            statistics.count = self.count
            learner.rate = self.rate


def of_checkpoint(saved: Checkpoint) -> Beginning:
    """Returns the networks and statistics of a tracker's checkpoint.

    Raises:
        InputError: if the checkpoint lacks some of them.
    """
    with run_folder.sound(saved.path):
        return Beginning(
            saved.path,
            run_folder.networks(saved),
            saved.tensors["normalizer/mean"].numpy(),
            saved.tensors["normalizer/variance"].numpy(),
            float(saved.state["normalizer_count"]),
            float(saved.state["learning_rate"]),
        )


def read_beginning(path: Path, hidden: list[int], layout: Layout = LAYOUT) -> Beginning:
    """Reads a checkpoint or a policy file whose networks have the widths ``hidden``.

    Its observations must have the layout, by default that of three joints a leg.

    Raises:
        InputError: if the file is missing, damaged, of something else, or a policy
            without its critic; or if widths or observation are others.
    """
    if kind_of(path) == KIND:
        beginning, own, parts = _of_policy(path)
    else:
        saved = run_folder.read_checkpoint(path, NAME)
        with run_folder.sound(path):
            own, parts = saved.run["hidden"], saved.run["observation_layout"]
        beginning = of_checkpoint(saved)
        beside = path.with_name(RECOVERY)
        if beside.is_file():
            beginning = replace(beginning, recovery=read_actor(beside)[0])
    if own != hidden:
        raise InputError(f"{path} is of networks with --hidden {own}, not {hidden}.")
    wanted = list(layout.record)
    if (parts or wanted) != wanted:
        raise InputError(f"{path} is of another observation layout.")
    return beginning


def _of_policy(path: Path) -> tuple[Beginning, list[int], list[list[Any]]]:
    """Returns the beginning in a policy file, its widths and observation layout."""
    policy, learner = read_actor(path)
    config, actor = policy.config, policy.state_dict()
    if not learner:
        raise InputError(
            f"{path} holds a policy without its critic; start from the checkpoint of "
            "its training."
        )
    with run_folder.sound(path):
        networks = dict(learner)
        count, rate = (float(networks.pop(name)) for name in ("count", "rate"))
        mean, variance = (actor[n].double().numpy() for n in ("mean", "variance"))
        for ours, theirs in actor_layers(len(config.hidden)).items():
            for part in ("weight", "bias"):
                networks[f"{theirs}.{part}"] = actor[f"{ours}.{part}"]
        recovery = recovery_of(policy)
        beginning = Beginning(path, networks, mean, variance, count, rate, recovery)
    return beginning, config.hidden, config.observation_layout


def save_policy(
    learner: AdaptivePPO,
    config: ActorConfig,
    path: Path,
    recovery: Actor | None = None,
) -> None:
    """Writes the learner's policy, and what else :func:`read_beginning` needs.

    With a recovery, its network acts far from the plan.
    """
    of_actor = tuple(actor_layers(len(config.hidden)).values())
    beside = {
        name: value
        for name, value in learner.policy.state_dict().items()
        if not name.startswith(of_actor)
    }
    beside["count"] = torch.tensor(float(learner.statistics.count), dtype=torch.float64)
    beside["rate"] = torch.tensor(learner.rate, dtype=torch.float64)
    actor = export_actor(learner, config)
    if recovery is not None:
        actor = joined(actor, recovery)
    save_actor(actor, path, learner=beside)


def keep_recovery(
    folder: Path, beginning: Beginning | None, config: ActorConfig
) -> Actor | None:
    """Returns what acts far from the plan in a training's policy, if anything does.

    It is that of the policy that the training begins with, if that is of the same robot
    and kind, and is kept in the training's folder.
    """
    path = folder / RECOVERY
    found = None if beginning is None else beginning.recovery
    names = ("robot", "privileged", "hidden")
    if found and all(getattr(found.config, n) == getattr(config, n) for n in names):
        save_actor(found, path)
    return read_actor(path)[0] if path.is_file() else None
