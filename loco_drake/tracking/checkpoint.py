"""All that training needs to go on, in one safetensors file (never a pickle)."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from loco_drake.common.weights import load_weights, save_weights
from loco_drake.tracking.ppo import AdaptivePPO
from loco_drake.tracking.sampler import PlanSampler

KIND = "tracker checkpoint"


def save_checkpoint(
    path: Path, learner: AdaptivePPO, sampler: PlanSampler, config: dict[str, Any]
) -> None:
    """Writes networks, optimizer, normalizer, sampler and random states.

    Args:
        path: a .safetensors file.
        learner: what is being trained.
        sampler: what draws its plans.
        config: how it is trained, to be compared when it is resumed; must be JSON.
    """
    tensors: dict[str, Tensor] = {
        f"policy/{name}": value for name, value in learner.policy.state_dict().items()
    }
    optimizer = learner.policy.optimizer.state_dict()
    for index, moments in optimizer["state"].items():
        for name, value in moments.items():
            tensors[f"optimizer/{index}/{name}"] = value
    statistics = learner.statistics
    tensors["normalizer/mean"] = torch.from_numpy(statistics.mean)
    tensors["normalizer/variance"] = torch.from_numpy(statistics.var)
    tensors["sampler/scores"] = torch.from_numpy(sampler.scores)
    tensors["sampler/shares"] = torch.from_numpy(sampler.shares)
    tensors["sampler/plan_scores"] = torch.from_numpy(sampler.plan_scores)
    tensors["sampler/plan_shares"] = torch.from_numpy(sampler.plan_shares)
    tensors["random/torch"] = torch.get_rng_state()
    # stable-baselines3 shuffles its minibatches with numpy's global generator.
    _, keys, position, has_gauss, gauss = np.random.get_state()  # noqa: NPY002
    tensors["random/numpy"] = torch.from_numpy(np.asarray(keys).astype(np.int64))
    state = {
        "steps": learner.num_timesteps,
        "learning_rate": learner.rate,
        "normalizer_count": float(statistics.count),
        "sampler_random": sampler.random.bit_generator.state,
        "numpy_random": [int(position), int(has_gauss), float(gauss)],
    }
    save_weights(path, KIND, tensors, {"state": state, "config": config})


def load_checkpoint(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Returns the tensors and ``{"state", "config"}`` of a checkpoint.

    Raises:
        InputError: if there is none, or it is damaged.
    """
    return load_weights(path, KIND, ("sampler/plan_scores", "sampler/plan_shares"))


def start_from(
    learner: AdaptivePPO, tensors: dict[str, Tensor], state: dict[str, Any]
) -> None:
    """Gives ``learner`` the networks and the normalizer of a checkpoint, no more."""
    learner.policy.load_state_dict(_part(tensors, "policy"))
    statistics = learner.statistics
    statistics.mean = tensors["normalizer/mean"].numpy()
    statistics.var = tensors["normalizer/variance"].numpy()
    statistics.count = state["normalizer_count"]


def restore(
    learner: AdaptivePPO,
    sampler: PlanSampler,
    tensors: dict[str, Tensor],
    state: dict[str, Any],
) -> None:
    """Puts ``learner`` and ``sampler`` where the checkpoint left them.

    Among other plans than those of the checkpoint, what it knows of each is left out.
    """
    start_from(learner, tensors, state)
    moments: dict[int, dict[str, Tensor]] = {}
    for key, value in _part(tensors, "optimizer").items():
        index, name = key.split("/")
        moments.setdefault(int(index), {})[name] = value
    optimizer = learner.policy.optimizer
    groups = optimizer.state_dict()["param_groups"]
    optimizer.load_state_dict({"state": moments, "param_groups": groups})
    sampler.scores[:] = tensors["sampler/scores"].numpy()
    sampler.shares[:] = tensors["sampler/shares"].numpy()
    scores = tensors.get("sampler/plan_scores")
    if scores is not None and len(scores) == len(sampler.plan_scores):
        sampler.plan_scores[:] = scores.numpy()
        sampler.plan_shares[:] = tensors["sampler/plan_shares"].numpy()
    sampler.random.bit_generator.state = state["sampler_random"]
    torch.set_rng_state(tensors["random/torch"])
    position, has_gauss, gauss = state["numpy_random"]
    keys = tensors["random/numpy"].numpy().astype(np.uint32)
    np.random.set_state(("MT19937", keys, position, has_gauss, gauss))  # noqa: NPY002
    learner.num_timesteps = state["steps"]
    learner.rate = state["learning_rate"]


def _part(tensors: dict[str, Tensor], name: str) -> dict[str, Tensor]:
    prefix = f"{name}/"
    return {
        key.removeprefix(prefix): value
        for key, value in tensors.items()
        if key.startswith(prefix)
    }
