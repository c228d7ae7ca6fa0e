"""Returns of a policy without the noise of its training."""

from math import inf

import numpy as np
import torch

from loco_drake.control.actor import Actor
from loco_drake.control.plan import Plan
from loco_drake.control.state import TerminationConfig
from loco_drake.models.plant import PlantConfig
from loco_drake.motion.gaits import ROW_LABELS
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise


def exact_returns(
    actor: Actor, plans: list[Plan], steps: int, plant: PlantConfig
) -> dict[str, float]:
    """Returns by label the mean normalized return of an episode on each plan, 0-100.

    Robots start on their plans and are simulated in the model's world, without noise of
    start or actions, for ``steps`` control periods, or as many as the shortest plan
    has. Only a fall ends an episode, whose further steps count as 0. `evaluate
    tracking` measures the same while plans are smoothed on the way.
    """
    steps = min(steps, *(len(plan) - 1 for plan in plans))
    config = EnvironmentConfig(
        robot=actor.config.robot,
        plant=plant,
        termination=TerminationConfig(position=inf, rotation=inf),
        episode_steps=steps,
        reset_noise=ResetNoise(joints=0.0, velocities=0.0, position=0.0, heading=0.0),
    )
    batch = TrackingBatch(plans, config, len(plans))
    unused = np.random.default_rng(0)
    for i in range(len(plans)):
        batch.reset(i, unused, i, 0)
    sums, stands = np.zeros(len(plans)), np.ones(len(plans), dtype=bool)
    for _ in range(steps):
        with torch.inference_mode():
            actions = actor(torch.from_numpy(batch.observe())).numpy()
        terms, fell, _ = batch.step(actions)
        stands &= ~fell
        sums += stands * terms.sum(axis=-1)
    returns, labels = 100 * sums / steps, np.array([plan.labels[0] for plan in plans])
    return {
        str(ROW_LABELS[i]): float(returns[labels == i].mean())
        for i in np.unique(labels)
    }
