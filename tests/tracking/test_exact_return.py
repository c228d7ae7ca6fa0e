from math import inf

import numpy as np
import pytest
import torch

from loco_drake.control.actor import Actor
from loco_drake.control.actor_file import load_actor
from loco_drake.control.state import TerminationConfig
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.environment import TrackingEnv
from loco_drake.tracking.exact_return import exact_returns

STEPS = 60


@pytest.fixture(scope="module")
def actor():
    return load_actor(pretrained_path("policy_go2"), get_robot("go2"))


def rewards(actor: Actor, plans, plan: int) -> list[float]:
    """Of an episode in the Gymnasium environment, until a fall."""
    environment = TrackingEnv(
        plans,
        EnvironmentConfig(
            termination=TerminationConfig(position=inf, rotation=inf),
            reset_noise=ResetNoise(joints=0, velocities=0, position=0, heading=0),
        ),
    )
    observation, _ = environment.reset(seed=1, options={"plan": plan, "sample": 0})
    found = []
    for _ in range(STEPS):
        with torch.inference_mode():
            action = actor(torch.from_numpy(observation[None]))[0].numpy()
        observation, reward, fell, *_ = environment.step(action)
        if fell:
            break
        found.append(reward)
    return found


def test_returns_are_those_of_single_episodes(actor, plans):
    """A trot twice and a pace: the mean of each label over the maximum, 1 a step."""
    returns = exact_returns(actor, [plans[0], plans[1], plans[0]], STEPS, PlantConfig())
    for label, plan in (("dog-trot", 0), ("dog-pace", 1)):
        episode = rewards(actor, plans, plan)
        assert len(episode) == STEPS
        assert returns[label] == pytest.approx(100 * sum(episode) / STEPS, abs=1e-3)
    assert returns.keys() == {"dog-trot", "dog-pace"}
    assert min(returns.values()) > 60


def test_steps_lost_to_a_fall_count_as_0(actor, plans):
    """A policy that throws the legs about: what it earned before, over all steps."""
    wild, random = Actor(actor.config), torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in wild.parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=random))
    episode = rewards(wild, plans, 0)
    assert len(episode) < STEPS
    returns = exact_returns(wild, plans[:1], STEPS, PlantConfig())
    assert returns["dog-trot"] == pytest.approx(100 * sum(episode) / STEPS, abs=1e-3)


def test_episodes_are_no_longer_than_the_shortest_plan(actor, plans):
    last = min(map(len, plans)) - 1
    long = exact_returns(actor, plans, 10_000, PlantConfig())
    assert long == exact_returns(actor, plans, last, PlantConfig())
    assert all(np.isfinite(x) for x in long.values())
