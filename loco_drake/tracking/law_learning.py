"""How a policy learns the laws of a round."""

import math
from statistics import fmean

import numpy as np
import torch

from loco_drake.control.actor import Actor
from loco_drake.control.plan import Plan
from loco_drake.tracking.guided_config import GuidedConfig
from loco_drake.tracking.laws import Laws, law_loss
from loco_drake.tracking.visited import visit


def learn_laws(
    policy: Actor, laws: Laws, plans: list[Plan], config: GuidedConfig, number: int
) -> float:
    """Learns the laws; returns the mean loss of the last tenth of the updates.

    With ``config.keep``, it stays as it is where it gets to: the distance of its
    actions from those before the round counts, too.
    """
    random = np.random.default_rng((config.seed, number))
    kept = _kept(policy, plans, config, number) if config.keep else None
    # What acts far from the plan has learned more worlds than the model's, and forgets
    # them where there are few laws.
    learner = policy.layers if config.learns == "near" else policy.recovery
    learner.requires_grad_(True)
    optimizer = torch.optim.Adam(learner.parameters(), lr=config.learning_rate)
    losses = []
    for update in range(config.updates):
        for group in optimizer.param_groups:
            share = (1 + math.cos(math.pi * update / config.updates)) / 2
            group["lr"] = config.learning_rate * share
        seen, told, weights = laws.draw(random, config.minibatch)
        loss = law_loss(policy(seen), told, weights)
        losses.append(loss.item())
        if kept is not None:
            visited, done = kept
            i = torch.from_numpy(random.integers(len(done), size=config.minibatch))
            alike = torch.eye(done.shape[-1]).expand(len(i), -1, -1)
            loss = loss + config.keep * law_loss(policy(visited[i]), done[i], alike)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
    learner.requires_grad_(False)
    return fmean(losses[-math.ceil(len(losses) / 10) :])


def _kept(
    policy: Actor, plans: list[Plan], config: GuidedConfig, number: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Returns observations (N, size) where a policy gets to, and its actions (N, J)."""
    random = np.random.default_rng((config.seed, number, 1))
    world, count = config.environment, config.kept_stretches
    visited = visit(plans, policy, world, config.stretch, random, count)
    with torch.no_grad():
        return visited, torch.cat(
            [policy(part) for part in torch.split(visited, 10_000)]
        )
