"""Files of policies: their networks, and what a training needs to start from them."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from loco_drake.common.arrays import Array
from loco_drake.common.determinism import single_thread
from loco_drake.common.errors import InputError
from loco_drake.common.weights import (
    build_network,
    load_weights,
    read_config,
    save_weights,
)
from loco_drake.control.actor import Actor, ActorConfig, config_for
from loco_drake.control.history_actor import HistoryActor
from loco_drake.models.simulated import SimulatedRobot

KIND = "policy"
# The feed-forward of policies whose files do not name it: equal shares of the weight.
_FIRST_FEED_FORWARD = "weight"
_LEARNER = "learner/"  # prefix of tensors that only a training needs
# May be another policy's.
_FREE = ("labels", "hidden", "privileged", "history", "recovery")


def make_actor(config: ActorConfig) -> Actor:
    """Returns a network with initial weights, with a memory if it has a history."""
    return Actor(config) if config.history is None else HistoryActor(config)


def act(actor: Actor, observation: Array, memory: Array) -> tuple[Array, Array]:
    """Returns action and next memory, as :meth:`Actor.step`, of arrays."""
    inputs = (torch.tensor(x, dtype=torch.float32) for x in (observation, memory))
    # For user processes: a second torch thread would wait for a busy core.
    with torch.inference_mode(), single_thread():
        action, memory_after = actor.step(*inputs)
        return action.double().numpy(), memory_after.double().numpy()


def save_actor(
    actor: Actor, path: Path, learner: Mapping[str, Tensor] | None = None
) -> None:
    """Writes the policy's weights, and what a training needs to start from them."""
    tensors = dict(actor.state_dict())
    tensors |= {f"{_LEARNER}{name}": value for name, value in (learner or {}).items()}
    save_weights(path, KIND, tensors, asdict(actor.config))


def halve_policy(source: Path, target: Path) -> None:
    """Copies a policy file with its networks in 16 bits, half the size.

    Raises:
        InputError: if ``source`` is missing, damaged, or no policy.
    """
    tensors, config = load_weights(source, KIND)
    for name, value in tensors.items():
        # The normalizer's statistics exceed the range of 16 bits.
        if value.dtype == torch.float32 and name not in ("mean", "variance"):
            tensors[name] = value.half()
    save_weights(target, KIND, tensors, config)


def split_learner(
    tensors: Mapping[str, Tensor],
) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Returns the actor's tensors of a policy file, and the learner's."""
    actor, learner = {}, {}
    for name, value in tensors.items():
        if name.startswith(_LEARNER):
            learner[name.removeprefix(_LEARNER)] = value
        else:
            actor[name] = value
    return actor, learner


def read_actor_config(header: Any, path: Path) -> ActorConfig:
    """Returns the configuration in the header of a policy file.

    Raises:
        InputError: if the header is damaged.
    """
    if isinstance(header, dict):
        header = {"feed_forward": _FIRST_FEED_FORWARD, **header}
    return read_config(ActorConfig, header, path)


def read_actor(path: Path) -> tuple[Actor, dict[str, Tensor]]:
    """Reads a policy of any robot, and the learner's tensors beside it.

    Raises:
        InputError: if the file is missing or damaged.
    """
    tensors, header = load_weights(path, KIND)
    config = read_actor_config(header, path)
    own, learner = split_learner(tensors)
    return build_network(path, make_actor, config, own).eval(), learner


def load_actor(path: Path, robot: SimulatedRobot) -> Actor:
    """Reads a policy for ``robot``.

    Raises:
        InputError: if the file is damaged, or was trained for another robot or with
            another observation, action scale, rate or feed-forward.
    """
    # The header first: it tells more than weights that do not fit.
    header = load_weights(path, KIND)[1]
    config = read_actor_config(header, path)
    free = {name: getattr(config, name) for name in _FREE}
    expected = config_for(robot, **free)
    for name, value in asdict(expected).items():
        if (trained := getattr(config, name)) != value:
            what = name.replace("_", " ")
            detail = f": {trained}, not {value}" if name == "robot" else ""
            raise InputError(f"The policy in {path} is for another {what}{detail}.")
    return read_actor(path)[0]
