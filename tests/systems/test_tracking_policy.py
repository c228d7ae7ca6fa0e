from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.weights import load_weights, save_weights
from loco_drake.control.actor import (
    Actor,
    ActorConfig,
    mirror_actions,
    mirror_observations,
)
from loco_drake.control.actor_file import halve_policy, load_actor, save_actor
from loco_drake.control.observation import OBSERVATION_LAYOUT, OBSERVATION_SIZE
from loco_drake.models.robots import get_robot
from loco_drake.systems.control import TrackingPolicy


@pytest.fixture
def actor():
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        actor = Actor(ActorConfig(robot="go2", labels=["dog-trot"], hidden=[8, 6]))
        actor.mean.normal_()
        actor.variance.uniform_(0.5, 2.0)
    return actor.eval()


def test_the_system_computes_the_network(actor):
    """By numpy: normalise, clip, two ELU layers, one linear; as it is and mirrored."""
    observation = 3 * np.random.default_rng(0).standard_normal(OBSERVATION_SIZE)
    policy = TrackingPolicy(actor)
    context = policy.CreateDefaultContext()
    policy.GetInputPort("observation").FixValue(context, observation)
    x = (observation - actor.mean.numpy()) / np.sqrt(actor.variance.numpy() + 1e-8)
    x = np.clip(x, -5, 5)
    weights = [p.detach().double().numpy() for p in actor.layers.parameters()]
    results = []
    for seen in (x, mirror_observations(x)):
        hidden = seen
        for W, b in zip(weights[0:4:2], weights[1:4:2], strict=True):
            hidden = W @ hidden + b
            hidden = np.where(hidden > 0, hidden, np.exp(np.minimum(hidden, 0)) - 1)
        results.append(weights[4] @ hidden + weights[5])
    expected = (results[0] + mirror_actions(results[1])) / 2
    action = policy.GetOutputPort("action").Eval(context)
    np.testing.assert_allclose(action, expected, atol=1e-5)


def test_the_network_runs_on_one_thread_and_gives_the_others_back(actor):
    """In the process of a user who set torch to two."""
    seen = []
    actor.layers.register_forward_pre_hook(
        lambda *_: seen.append(torch.get_num_threads())
    )
    policy = TrackingPolicy(actor)
    context = policy.CreateDefaultContext()
    policy.GetInputPort("observation").FixValue(context, np.ones(OBSERVATION_SIZE))
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        policy.GetOutputPort("action").Eval(context)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    assert seen == [1, 1]  # the observation and its mirror image


def test_hidden_parts_are_at_their_mean(actor):
    """Actions are those of a privileged actor that sees the mean there.

    The mean must be its own mirror image, as training's is.
    """
    actor.mean.copy_((actor.mean + mirror_observations(actor.mean)) / 2)
    actor.variance.fill_(0.5)
    observation = torch.randn(4, OBSERVATION_SIZE)
    mean_there, start = observation.clone(), 0
    for name, size in OBSERVATION_LAYOUT:
        if name in ("v_WB_H", "height", "plan_p_H"):
            mean_there[:, start : start + size] = actor.mean[start : start + size]
        start += size
    with torch.inference_mode():
        expected, privileged = actor(mean_there), actor(observation)
        actor.config = replace(actor.config, privileged=False)
        hidden = actor(observation)
    torch.testing.assert_close(hidden, expected)
    assert (hidden - privileged).abs().max() > 1e-3


def test_weights_know_whether_they_are_privileged_and_old_ones_are(actor, tmp_path):
    path = tmp_path / "policy.safetensors"
    actor.config = replace(actor.config, privileged=False)
    save_actor(actor, path)
    again = load_actor(path, get_robot("go2"))
    assert not again.config.privileged
    observation = torch.randn(OBSERVATION_SIZE)
    with torch.inference_mode():
        torch.testing.assert_close(again(observation), actor(observation))
    tensors, config = load_weights(path, "policy")
    del config["privileged"]
    save_weights(path, "policy", tensors, config)
    assert load_actor(path, get_robot("go2")).config.privileged


@pytest.mark.parametrize("half", [False, True])
def test_saved_policies_come_back(actor, tmp_path, half):
    path = tmp_path / "policy.safetensors"
    save_actor(actor, path)
    if half:
        halve_policy(path, path)
    again = load_actor(path, get_robot("go2"))
    assert again.config == actor.config
    tolerance = 1e-3 if half else 0.0
    loaded = again.state_dict()
    for name, value in actor.state_dict().items():
        torch.testing.assert_close(loaded[name], value, rtol=tolerance, atol=tolerance)


def test_a_policy_of_another_robot_is_refused(actor, tmp_path):
    path = tmp_path / "policy.safetensors"
    save_actor(actor, path)
    with pytest.raises(InputError, match="for another robot: go2, not a1"):
        load_actor(path, get_robot("a1"))


def test_a_policy_of_another_observation_is_refused(actor, tmp_path):
    path = tmp_path / "policy.safetensors"
    save_actor(actor, path)
    tensors, config = load_weights(path, "policy")
    config["observation_layout"][0][0] = "gravity_W"
    save_weights(path, "policy", tensors, config)
    with pytest.raises(InputError, match="another observation layout"):
        load_actor(path, get_robot("go2"))


def test_damaged_weights_are_refused(actor, tmp_path):
    path = tmp_path / "policy.safetensors"
    save_actor(actor, path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match="damaged"):
        load_actor(path, get_robot("go2"))
