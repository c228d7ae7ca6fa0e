"""Actor and critic in training: left is as good as right."""

import numpy as np
import pytest
import torch

from loco_drake.control.actor import mirror_actions, mirror_observations
from loco_drake.control.observation import OBSERVATION_LAYOUT, OBSERVATION_SIZE
from loco_drake.tracking.environment import ACTION_SPACE, OBSERVATION_SPACE
from loco_drake.tracking.ppo import SymmetricPolicy, SymmetricStatistics


def test_an_image_is_as_likely_and_as_valuable_as_the_step():
    torch.manual_seed(0)
    policy = SymmetricPolicy(OBSERVATION_SPACE, ACTION_SPACE, lambda _: 1e-3)
    torch.nn.init.normal_(policy.action_net.weight, std=0.1)
    observations = torch.randn(6, OBSERVATION_SIZE)
    actions = torch.randn(6, 12)
    with torch.inference_mode():
        value, log_prob, _ = policy.evaluate_actions(observations, actions)
        image = mirror_observations(observations), mirror_actions(actions)
        image_value, image_log_prob, _ = policy.evaluate_actions(*image)
        changed = policy.evaluate_actions(observations, image[1])[1]
    torch.testing.assert_close(value, image_value)
    torch.testing.assert_close(log_prob, image_log_prob)
    assert (changed - log_prob).abs().max() > 0.1


def test_an_unprivileged_actor_sees_less_and_its_critic_all():
    """Other positions and speeds of the base: the same actions, other values."""
    torch.manual_seed(0)
    policy = SymmetricPolicy(
        OBSERVATION_SPACE, ACTION_SPACE, lambda _: 1e-3, privileged=False
    )
    torch.nn.init.normal_(policy.action_net.weight, std=0.1)
    observations = torch.randn(6, OBSERVATION_SIZE)
    others = observations.clone()
    start, hidden = 0, 0
    for name, size in OBSERVATION_LAYOUT:
        if name in ("v_WB_H", "height", "plan_p_H"):
            others[:, start : start + size] = torch.randn(6, size)
            hidden += size
        start += size
    assert hidden == 3 + 1 + 12
    seen = observations.clone()
    seen[:, 0] += 1.0  # gravity
    with torch.inference_mode():
        mean = policy.get_distribution(observations).distribution.mean
        other_mean = policy.get_distribution(others).distribution.mean
        seen_mean = policy.get_distribution(seen).distribution.mean
        mirrored = mirror_observations(observations)
        image_mean = policy.get_distribution(mirrored).distribution.mean
        values = policy.predict_values(observations)
        other_values = policy.predict_values(others)
    torch.testing.assert_close(other_mean, mean, rtol=0, atol=0)
    assert (seen_mean - mean).abs().max() > 1e-3
    torch.testing.assert_close(image_mean, mirror_actions(mean))
    assert (other_values - values).abs().min() > 1e-6


def test_sampled_actions_have_the_probability_that_is_told():
    torch.manual_seed(1)
    policy = SymmetricPolicy(OBSERVATION_SPACE, ACTION_SPACE, lambda _: 1e-3)
    observations = torch.randn(6, OBSERVATION_SIZE)
    with torch.inference_mode():
        actions, values, log_prob = policy(observations)
        again = policy.evaluate_actions(observations, actions)
        mean = policy(observations, deterministic=True)[0]
        distribution = policy.get_distribution(observations)
    torch.testing.assert_close(values, again[0])
    torch.testing.assert_close(log_prob, again[1])
    torch.testing.assert_close(mean, distribution.distribution.mean)


def test_normalized_observations_mirror_like_any():
    """Left joints at 1, right ones at 0: the statistics are those of both sides."""
    statistics = SymmetricStatistics(shape=(OBSERVATION_SIZE,))
    random = np.random.default_rng(3)
    for _ in range(3):
        statistics.update(1.0 + random.standard_normal((50, OBSERVATION_SIZE)))
    np.testing.assert_allclose(
        mirror_observations(statistics.mean), statistics.mean, atol=1e-6
    )
    assert statistics.mean[1] == pytest.approx(0.0, abs=1e-12)  # y of gravity
    assert statistics.count == pytest.approx(300, abs=1)
