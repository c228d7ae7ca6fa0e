"""What a policy observes where it gets to by itself."""

import numpy as np
import torch
from torch import Tensor

from loco_drake.control.actor import Actor
from loco_drake.control.plan import Plan
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.guided_config import StretchConfig

_ROBOTS = 50  # simulated side by side


def visit(
    plans: list[Plan],
    actor: Actor,
    environment: EnvironmentConfig,
    config: StretchConfig,
    random: np.random.Generator,
    stretches: int,
) -> Tensor:
    """Returns observations (N, size) on random stretches, until the plan is lost.

    The stretches begin as those of :func:`.guidance.find_law`, with the same pushes.
    """
    batch = TrackingBatch(plans, environment, min(_ROBOTS, stretches))
    robots = np.arange(len(batch.plan))
    seen = []
    for begun in range(0, stretches, len(robots)):
        leads = np.zeros_like(robots)
        for i in range(len(robots)):
            plan = int(random.integers(len(plans)))
            first, leads[i] = config.draw(random, len(plans[plan]))
            batch.reset(i, random, plan, first)
        lengths = np.array([len(plans[k]) for k in batch.plan])
        ends = np.minimum(batch.start + leads + config.length, lengths - 2)
        on = robots < stretches - begun
        for step in range(config.lead + config.length):
            for i in np.flatnonzero(on & (leads == step)).tolist():
                batch.push(i, config.draw_push(random))
            on &= batch.sample < ends
            if not on.any():
                break
            observation = torch.from_numpy(batch.observe())
            seen.append(observation[torch.from_numpy(on & (leads <= step))])
            with torch.inference_mode():
                actions = actor(observation).numpy()
            # What has come to its end waits there.
            batch.sample = np.minimum(batch.sample, lengths - 2)
            _, lost, _ = batch.step(actions)
            on &= ~lost
    return torch.cat(seen)
