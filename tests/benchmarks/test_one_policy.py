"""Both robots in one training: what tells them apart, and that nothing else does."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv

from loco_drake.models.robots import get_robot
from loco_drake.systems.joint_targets import ACTION_SCALE
from loco_drake.systems.observation import OBSERVATION_SIZE, observe, preview
from loco_drake.systems.symmetry import mirror_actions
from loco_drake.tracking.checkpoint import (
    load_checkpoint,
    save_checkpoint,
    start_from,
)
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.environment import TrackingEnv
from loco_drake.tracking.ppo import PpoConfig, make_ppo
from loco_drake.tracking.references import smooth_motions
from loco_drake.tracking.sampler import PlanSampler
from tests.synthetic_motion import synthetic_motion

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
TINY = PpoConfig(batch=32, minibatch=32, epochs=1, hidden=[16, 8])


@pytest.fixture(scope="module")
def script():
    """What both files define."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        names = ("both_robots", "one_policy")
        both, trial = (runpy.run_path(str(BENCHMARKS / f"{n}.py")) for n in names)
    return both | trial


@pytest.fixture(scope="module")
def plans():
    """A slow trot of each robot, a little longer than an episode."""
    return {
        name: smooth_motions(
            get_robot(name), [synthetic_motion("dog-trot", 4.5, 0.3, name=name)]
        )
        for name in ("go2", "a1")
    }


@pytest.fixture(scope="module")
def narrow(plans):
    """A learner on the A1 alone whose networks do something."""
    alone = DummyVecEnv(
        [lambda: TrackingEnv(plans["a1"], EnvironmentConfig(robot="a1"))]
    )
    learner = make_ppo(alone, TINY, 0)
    with torch.no_grad():
        learner.policy.action_net.weight.normal_(std=0.3)
    learner.statistics.update(np.random.default_rng(1).normal(size=(50, 182)))
    return learner


@pytest.fixture(scope="module")
def first(narrow, plans, tmp_path_factory):
    """Its checkpoint."""
    path = tmp_path_factory.mktemp("first") / "a1.safetensors"
    save_checkpoint(path, narrow, PlanSampler(plans["a1"], 0), {})
    return path


@pytest.fixture
def both(script, plans):
    """Three Go2 and an A1, whose episodes are over after two steps."""

    def environment(name):
        config = EnvironmentConfig(robot=name, episode_steps=2)
        return lambda: TrackingEnv(plans[name], config)

    counts = {"go2": 3, "a1": 1}
    parts = {n: DummyVecEnv([environment(n)] * count) for n, count in counts.items()}
    for part in parts.values():
        part.seed(
            0
        )  # of where in their plans they start, at least two steps before the end
    return script["SideBySide"](parts)


def test_observations_tell_which_robot_it_is_to_the_last(both):
    """That holds for those at the end of an episode, too, which bootstrap the value."""
    one_hots = [[1, 0], [1, 0], [1, 0], [0, 1]]
    seen = both.reset()
    for _ in range(2):
        assert seen.shape == (4, OBSERVATION_SIZE + 2)
        np.testing.assert_array_equal(seen[:, OBSERVATION_SIZE:], one_hots)
        seen, rewards, dones, infos = both.step(np.zeros((4, 12), dtype=np.float32))
    assert dones.all()
    assert rewards.shape == (4,)
    for info, one_hot in zip(infos, one_hots, strict=True):
        np.testing.assert_array_equal(info["terminal_observation"][-2:], one_hot)


def test_each_robot_gets_its_own_actions(both):
    """What was done last is part of the observation: columns 34 to 46."""
    both.reset()
    actions = np.arange(48, dtype=np.float32).reshape(4, 12) / 100
    seen = both.step(actions)[0]
    np.testing.assert_array_equal(seen[:, 34:46], actions)


@pytest.mark.parametrize("name", ["go2", "a1"])
def test_a_mirrored_world_is_observed_mirrored_by_the_same_robot(script, name):
    robot, motion = get_robot(name), synthetic_motion("dog-pace", 2.0, 0.4, name=name)
    (plan,) = smooth_motions(robot, [motion])
    (image,) = smooth_motions(robot, [motion.mirrored()])
    seen, seen_mirrored = (
        script["with_robot"](
            observe(robot, preview(p, 0.8), p.state[40], np.zeros(12)), name
        )
        for p in (plan, image)
    )
    mirrored = script["mirror"](seen)
    np.testing.assert_allclose(mirrored, seen_mirrored, atol=1e-6)
    np.testing.assert_array_equal(script["mirror"](mirrored), seen)
    assert np.abs(mirrored - seen).max() > 0.01
    tensor = script["mirror"](torch.from_numpy(seen.astype(np.float32)))
    np.testing.assert_array_equal(tensor.numpy(), mirrored.astype(np.float32))


def test_the_policy_of_both_robots_is_symmetric(script, both):
    """Action and value of the image, normalized by what both have seen."""
    learner = make_ppo(both, TINY, 0, script["mirror"])
    with torch.no_grad():
        learner.policy.action_net.weight.normal_(std=0.3)
    seen = np.random.default_rng(2).normal(size=(6, script["SIZE"]))
    learner.statistics.update(seen + 1.0)
    normalizer = learner.get_vec_normalize_env()
    results = []
    for observations in (seen, script["mirror"](seen)):
        normal = torch.from_numpy(normalizer.normalize_obs(observations)).float()
        with torch.inference_mode():
            distribution = learner.policy.get_distribution(normal)
            results.append(
                (distribution.distribution.mean, learner.policy.predict_values(normal))
            )
    (mean, value), (image_mean, image_value) = results
    torch.testing.assert_close(mirror_actions(mean), image_mean)
    torch.testing.assert_close(value, image_value)
    assert (mean - image_mean).abs().max() > 0.1


def test_wider_networks_begin_as_they_were_and_can_tell_robots_apart(
    script, narrow, first, both
):
    learner = make_ppo(both, TINY, 1, script["mirror"])
    tensors, header = load_checkpoint(first)
    start_from(learner, script["widen"](tensors), header["state"])
    seen = np.random.default_rng(3).normal(size=(6, OBSERVATION_SIZE))

    def act(learner, observations):
        normal = learner.get_vec_normalize_env().normalize_obs(observations)
        with torch.inference_mode():
            values = learner.policy.predict_values(torch.from_numpy(normal).float())
        actions, _ = learner.predict(normal.astype(np.float32), deterministic=True)
        return np.concatenate((actions, values.numpy()), axis=1)

    def of_both():
        return [act(learner, script["with_robot"](seen, r)) for r in ("go2", "a1")]

    go2, a1 = of_both()
    np.testing.assert_allclose(go2, act(narrow, seen), atol=1e-5)
    np.testing.assert_allclose(a1, go2, atol=1e-5)
    with torch.no_grad():
        learner.policy.mlp_extractor.policy_net[0].weight[:, -1] = 1.0
    go2, a1 = of_both()
    assert np.abs(a1 - go2).max() > 0.1


def test_a_robot_that_does_not_follow_scores_badly(script, narrow, first, both, plans):
    """Thighs half a rad off lose the plan within the episode."""
    learner = make_ppo(both, TINY, 1, script["mirror"])
    tensors, header = load_checkpoint(first)
    wide = script["widen"](tensors)
    # An actor without output leaves the set-points as the plan has them.
    wide["policy/action_net.weight"] = torch.zeros(12, 8)
    wide["policy/action_net.bias"] = torch.zeros(12)
    start_from(learner, wide, header["state"])
    fair = script["score"](learner, "go2", plans["go2"], 1)["dog-trot"]
    wide["policy/action_net.bias"] = torch.tensor([0.0, 0.5 / ACTION_SCALE, 0.0] * 4)
    start_from(learner, wide, header["state"])
    bad = script["score"](learner, "go2", plans["go2"], 1)["dog-trot"]
    assert bad["lost"] == 100.0
    assert bad["return"] < fair["return"] / 2
    assert 0 < bad["return"] < 50


def test_a_stopped_training_goes_on_from_its_checkpoints(
    script, first, plans, tmp_path
):
    settings = script["Settings"](plans, 2, TINY, 1.0, 1, 0)
    run = script["train_and_score"]
    half = run(settings, ["a1"], 32, first, tmp_path)
    whole = run(settings, ["a1"], 64, first, tmp_path)
    assert [line["steps"] for line in half["log"]] == [32]
    assert [line["steps"] for line in whole["log"]] == [32, 64]
    assert (half["steps"], whole["steps"]) == (32, 64)
    assert half["processor_s"] > 0
    assert whole["processor_s"] is None
    assert set(whole["scores"]) == {"go2", "a1"}
    assert whole["mistaken"] == {}
    moments, header = load_checkpoint(tmp_path / "a1.safetensors")
    assert header["state"]["steps"] == 64
    assert float(moments["optimizer/0/step"]) == 2  # gradient steps, one an update
