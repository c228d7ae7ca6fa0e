"""The variants of the tracker's training are what their rows say."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest
import torch

from loco_drake.errors import InputError
from loco_drake.models.robots import get_robot
from loco_drake.motion import save_motion
from loco_drake.systems.actor import ActorConfig
from loco_drake.systems.feed_forward import feed_forward_torques
from loco_drake.systems.observation import OBSERVATION_SIZE
from loco_drake.systems.plan import plan_from_motion
from loco_drake.systems.symmetry import mirror_actions, mirror_observations
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.environment import (
    ACTION_SPACE,
    OBSERVATION_SPACE,
    TrackingEnv,
)
from tests.synthetic_motion import synthetic_motion

FOLDER = Path(__file__).parents[2] / "benchmarks"
ROBOT = get_robot("go2")
LABELS = ("dog-pace", "dog-trot")


@pytest.fixture(scope="module")
def script():
    """The script as a module, which worker processes find under its name, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FOLDER)
        yield importlib.import_module("tracker_ablation")


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motions")
    for label in LABELS:
        for k in range(5):
            motion = synthetic_motion(label, 1.0 + 0.2 * k, 0.3)
            save_motion(motion, folder / f"{label}-{k}.npz")
    return folder


@pytest.fixture(scope="module")
def library(script, motions):
    return script.load_library(ROBOT, motions, LABELS)


def random_network(actor):
    """Gives a network weights at which observations matter, and statistics."""
    generator = torch.Generator().manual_seed(0)
    for parameter in actor.parameters():
        torch.nn.init.normal_(parameter, std=0.1, generator=generator)
    actor.mean.normal_(generator=generator)
    return actor.eval()


def test_the_last_of_five_plans_is_held_out(library, script, motions):
    assert len(library.training) == 8
    assert len(library.held_out) == 2
    longest = max(len(plan) for plan in library.training)
    assert min(len(plan) for plan in library.held_out) > longest
    with pytest.raises(InputError, match=r"0 motions dog-walk-\*\.npz"):
        script.load_library(ROBOT, motions, ("dog-walk",))


def test_what_is_left_without_feed_forward_are_positions_and_velocities(script):
    plan = plan_from_motion(ROBOT, synthetic_motion("dog-trot", 1.0, 0.3))
    left = script.without_feed_forward(ROBOT, plan)
    torques = feed_forward_torques(ROBOT, plan.q, plan.v, plan.contacts)
    assert np.abs(torques).max() > 5.0
    np.testing.assert_allclose(
        ROBOT.kp * (plan.set_points - left.set_points), torques, atol=1e-9
    )
    np.testing.assert_array_equal(left.state, plan.state)


def changed_inputs(network):
    """Returns which parts of an observation, one number each, move the output."""
    observation = torch.zeros(1, OBSERVATION_SIZE)
    others = observation + torch.eye(OBSERVATION_SIZE)
    with torch.inference_mode():
        moved = (network(others) - network(observation)).abs().amax(dim=1)
    return moved > 1e-6


def test_one_variant_sees_one_sample_of_its_plan(script):
    """72 numbers: three more samples of 12 joints, 12 of the base and 4 contacts."""
    config = ActorConfig(robot="go2", labels=[])
    assert changed_inputs(random_network(script.Actor(config))).all()
    seen = changed_inputs(random_network(script.NearActor(config)))
    assert OBSERVATION_SIZE - int(seen.sum()) == 3 * (12 + 12 + 4)
    # State and last action, velocities and joints of the next sample.
    assert seen[: 46 + 12 + 12].all()
    assert not seen[46 + 12 + 12 : 46 + 12 + 48].any()


@pytest.mark.parametrize("name", ["no symmetry", "sees the next sample only"])
def test_the_network_that_is_scored_is_the_one_that_was_trained(script, name):
    variant = script.VARIANTS[name]
    policy = variant.patches["ppo.SymmetricPolicy"](
        OBSERVATION_SPACE,
        ACTION_SPACE,
        lambda _: 1e-3,
        net_arch={"pi": [256, 128], "vf": [256, 128]},
        activation_fn=torch.nn.ELU,
    )
    actor = random_network(variant.actor(ActorConfig(robot="go2", labels=[])))
    torch.nn.init.zeros_(actor.mean)
    layers = [*policy.mlp_extractor.policy_net, policy.action_net]
    for theirs, ours in zip(layers, actor.layers, strict=True):
        theirs.load_state_dict(ours.state_dict())
    observations = torch.randn(
        4, OBSERVATION_SIZE, generator=torch.Generator().manual_seed(1)
    )
    with torch.inference_mode():
        mean = policy.get_distribution(observations).distribution.mean
        image = policy.get_distribution(mirror_observations(observations))
        torch.testing.assert_close(actor(observations), mean)
        asymmetry = (image.distribution.mean - mirror_actions(mean)).abs().max()
    assert (asymmetry > 1e-2) == (name == "no symmetry")


def test_one_variant_starts_at_the_beginning(library, script):
    random = np.random.default_rng(0)
    starts = {}
    for batch_type in (script.TrackingBatch, script.FromBeginning):
        batch = batch_type(library.training, EnvironmentConfig(episode_steps=20), 1)
        drawn = []
        for _ in range(20):
            batch.reset(0, random, 0)
            drawn.append(int(batch.start[0]))
        starts[batch_type] = drawn
    assert set(starts[script.FromBeginning]) == {0}
    assert len(set(starts[script.TrackingBatch])) > 5


def test_a_score_is_the_reward_of_the_environment_until_a_fall(library, script):
    """Each episode alone, in the environment; steps that were not made count 0."""
    steps = 80
    config = EnvironmentConfig(
        episode_steps=steps,
        termination=script.ONLY_FALLS,
        reset_noise=ResetNoise(joints=0, velocities=0, position=0, heading=0),
    )
    environment = TrackingEnv(library.held_out, config)
    returns, falls = [], 0
    for i, plan in enumerate(library.held_out):
        for sample in (0, len(plan) - 1 - steps):
            environment.reset(seed=0, options={"plan": i, "sample": sample})
            total, over = 0.0, False
            while not over:
                _, reward, fell, ended, _ = environment.step(np.full(12, 1.0))
                total += reward * (not fell)
                over = fell or ended
            returns.append(100 * total / steps)
            falls += fell

    class Constant(torch.nn.Module):
        def forward(self, observation):
            return torch.ones(len(observation), 12)

    figures = script.score(Constant(), library.held_out, steps)
    assert falls > 0
    assert figures["falls"] == falls / 4
    assert figures["return"] == pytest.approx(np.mean(returns), abs=1e-6)
    assert figures["beginning"] == pytest.approx(np.mean(returns[::2]), abs=1e-6)
    assert figures["dog-pace"] == pytest.approx(np.mean(returns[:2]), abs=1e-6)


def test_a_run_leaves_its_figures_and_is_not_done_again(
    script, motions, tmp_path, capsys
):
    """A variant whose patch must reach the worker process."""

    def table():
        script.main(
            references=motions,
            labels=LABELS,
            out=tmp_path,
            steps=64,
            seeds=(3,),
            variants=("starts where plans begin",),
            per_worker=2,
            batch=32,
        )
        return capsys.readouterr().out

    printed = table()
    file = tmp_path / "starts_where_plans_begin-64-3.json"
    figures = json.loads(file.read_text())
    assert figures["steps"] == 64
    assert f"| {figures['return']:.1f} | {figures['return']:.1f} |" in printed
    before = file.stat().st_mtime_ns
    assert table() == printed
    assert file.stat().st_mtime_ns == before
