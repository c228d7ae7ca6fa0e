import json
import signal
from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.run_folder import read_checkpoint
from loco_drake.common.weights import load_weights, save_weights
from loco_drake.control.actor import mirror_actions, mirror_observations
from loco_drake.control.actor_file import halve_policy, load_actor, save_actor
from loco_drake.control.observation import OBSERVATION_SIZE
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from loco_drake.tracking.config import EnvironmentConfig, PpoConfig, TrainingConfig
from loco_drake.tracking.joining import join_policies, recovery_of
from loco_drake.tracking.ppo import make_ppo
from loco_drake.tracking.randomization import STANDARD
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.train import train_tracker
from loco_drake.tracking.workers import WorkerVecEnv

pytestmark = pytest.mark.slow

CHECKPOINT = "checkpoint.safetensors"
TROT, PACE = parse_label("dog-trot").index, parse_label("dog-pace").index


def config(steps, **ppo):
    return TrainingConfig(
        steps=steps,
        workers=1,
        per_worker=2,
        environment=EnvironmentConfig(episode_steps=20),
        ppo=PpoConfig(batch=64, minibatch=32, epochs=2, hidden=[16, 16], **ppo),
    )


def saved_in(folder):
    return read_checkpoint(folder / CHECKPOINT, "tracker")


@pytest.fixture(scope="module")
def trained(plans, tmp_path_factory):
    """Two batches, then Ctrl-C in the third, then two more."""
    folder = tmp_path_factory.mktemp("tracker")

    def interrupt(steps, scores):
        if steps >= 128:
            signal.raise_signal(signal.SIGINT)

    first = train_tracker(plans, config(256), folder, report=interrupt)
    stopped = saved_in(folder)
    load_actor(folder / "policy.safetensors", get_robot("go2"))
    second = train_tracker(plans, config(256), folder, resume=True)
    ended = saved_in(folder)
    return folder, first, stopped, second, ended


def test_an_interruption_leaves_a_checkpoint_and_a_policy(trained):
    _, first, stopped, _, _ = trained
    assert first["interrupted"]
    assert first["steps"] == stopped.state["steps"] == 128


def test_a_resumed_training_goes_on_to_the_end(trained):
    _, _, stopped, second, ended = trained
    before, after = stopped.tensors, ended.tensors
    assert not second["interrupted"]
    assert second["steps"] == ended.state["steps"] == 256
    # Two epochs of two minibatches in each of four batches: Adam counts them all.
    steps = [v for k, v in after.items() if k.endswith("/step")]
    assert {float(step) for step in steps} == {16.0}
    counts = [saved.state["normalizer_count"] for saved in (stopped, ended)]
    assert counts[1] - counts[0] >= 128
    changed = [
        name
        for name, value in before.items()
        if name.startswith("module/") and not torch.equal(value, after[name])
    ]
    assert len(changed) == sum(name.startswith("module/") for name in before)


def test_what_is_restored_is_what_was_saved(trained, plans, tmp_path):
    """Nothing left to do: the checkpoint that is written equals the one read."""
    folder, _, _, _, ended = trained
    for name in ("checkpoint", "policy"):
        file = f"{name}.safetensors"
        (tmp_path / file).write_bytes((folder / file).read_bytes())
    train_tracker(plans, config(256), tmp_path, resume=True)
    again = saved_in(tmp_path)
    assert again.state == ended.state
    assert again.tensors.keys() == ended.tensors.keys()
    for name, value in ended.tensors.items():
        assert torch.equal(value, again.tensors[name]), name


def test_the_policy_is_the_learners(trained):
    """The shipped network computes what the checkpoint's weights say."""
    folder, tensors = trained[0], trained[4].tensors
    actor = load_actor(folder / "policy.safetensors", get_robot("go2"))
    observation = torch.randn(
        OBSERVATION_SIZE, generator=torch.Generator().manual_seed(0)
    )
    mean = tensors["normalizer/mean"]
    std = torch.sqrt(tensors["normalizer/variance"] + 1e-8)
    normal = ((observation - mean) / std).clamp(-5, 5).float()

    def network(x):
        for layer in ("mlp_extractor.policy_net.0", "mlp_extractor.policy_net.2"):
            W, b = (tensors[f"module/{layer}.{part}"] for part in ("weight", "bias"))
            x = torch.nn.functional.elu(W @ x + b)
        W, b = (tensors[f"module/action_net.{part}"] for part in ("weight", "bias"))
        return W @ x + b

    image = mirror_actions(network(mirror_observations(normal)))
    expected = (network(normal) + image) / 2
    with torch.inference_mode():
        torch.testing.assert_close(actor(observation), expected, atol=1e-5, rtol=1e-5)


def test_progress_is_logged(trained):
    folder = trained[0]
    lines = (folder / "progress.jsonl").read_text().splitlines()
    steps = [json.loads(line)["steps"] for line in lines]
    assert steps == sorted(steps)
    assert list(folder.glob("events.out.tfevents.*"))


def test_other_networks_cannot_be_resumed(trained, plans):
    other = config(256)
    other.ppo.hidden = [8, 8]
    with pytest.raises(InputError, match="hidden"):
        train_tracker(plans, other, trained[0], resume=True)


def test_a_training_can_start_from_another_one(trained, plans, tmp_path):
    """Networks and normalizer are its; steps, optimizer and sampler are new."""
    ended = trained[4]
    other = config(0)  # only begins
    other.environment.randomization = STANDARD
    figures = train_tracker(
        plans, other, tmp_path, first=trained[0] / "checkpoint.safetensors"
    )
    assert figures["steps"] == 0
    begun = saved_in(tmp_path)
    for name, value in ended.tensors.items():
        if name.startswith(("module/", "normalizer/")):
            torch.testing.assert_close(begun.tensors[name], value, rtol=0, atol=0)
    assert not [name for name in begun.tensors if name.startswith("optimizer/")]
    assert (begun.tensors["sampler/scores"] == 0).all()
    for name in ("normalizer_count", "learning_rate"):
        assert begun.state[name] == ended.state[name]


def test_a_policy_file_is_as_good_to_start_from_as_the_checkpoint(
    trained, plans, tmp_path
):
    """Its statistics have 32 bits; the first batch, from both, is the same."""
    begun = {}
    for name in ("checkpoint", "policy"):
        file = trained[0] / f"{name}.safetensors"
        train_tracker(plans, config(0), tmp_path / name, first=file)
        begun[name] = saved_in(tmp_path / name)
    a, b = begun.values()
    assert a.state == b.state
    assert a.tensors.keys() == b.tensors.keys()
    for name, value in a.tensors.items():
        tolerance = 1e-6 if name.startswith("normalizer/") else 0.0
        torch.testing.assert_close(
            b.tensors[name], value, rtol=tolerance, atol=0, equal_nan=True
        )


def test_a_policy_in_half_precision_can_be_started_from(trained, plans, tmp_path):
    """The diagram's policy and the learner's are the same network, in 16 bits."""
    whole, half = trained[0] / "policy.safetensors", tmp_path / "half.safetensors"
    halve_policy(whole, half)
    train_tracker(plans, config(0), tmp_path, first=half)
    again = tmp_path / "policy.safetensors"
    first, learned, exact = (
        load_actor(file, get_robot("go2")).state_dict() for file in (half, again, whole)
    )
    for name, value in first.items():
        assert torch.equal(value, learned[name]), name
        torch.testing.assert_close(value, exact[name], rtol=1e-3, atol=1e-4)
    assert half.stat().st_size < 0.7 * whole.stat().st_size


def test_what_acts_far_from_the_plan_stays_as_it_is(trained, plans, tmp_path):
    """Also when the training is resumed, or another one starts from its checkpoint."""
    near, far = trained[0] / "policy.safetensors", tmp_path / "far.safetensors"
    go2 = get_robot("go2")
    other = load_actor(near, go2)
    for parameter in other.parameters():
        parameter.data.mul_(1.1)
    save_actor(other, far)
    join_policies(near, far, tmp_path / "both.safetensors")
    first, run = tmp_path / "both.safetensors", tmp_path / "run"
    train_tracker(plans, config(64), run, first=first)
    train_tracker(plans, config(128), run, resume=True)
    again = tmp_path / "again"
    train_tracker(plans, config(0), again, first=run / "checkpoint.safetensors")
    # What is far from all that was seen is cut off, by the statistics of each.
    seen = other.mean + 0.3 * other.variance.sqrt() * torch.randn(8, OBSERVATION_SIZE)
    with torch.inference_mode():
        for folder in (run, again):
            policy = load_actor(folder / "policy.safetensors", go2)
            kept = recovery_of(policy)
            torch.testing.assert_close(kept(seen), other(seen), rtol=1e-3, atol=1e-4)
        moved = (policy.layers[0].weight - other.layers[0].weight / 1.1).abs().max()
        assert 0 < moved < 0.02
    # An actor that observes less cannot use it.
    blind = replace(config(0), ppo=replace(config(0).ppo, privileged=False))
    train_tracker(plans, blind, tmp_path / "blind", first=first)
    policy = load_actor(tmp_path / "blind" / "policy.safetensors", go2)
    assert policy.config.recovery is None


def test_a_policy_without_its_critic_is_refused(trained, plans, tmp_path):
    """As they were written before, or by save_actor."""
    actor = load_actor(trained[0] / "policy.safetensors", get_robot("go2"))
    save_actor(actor, tmp_path / "alone.safetensors")
    with pytest.raises(InputError, match="without its critic"):
        train_tracker(
            plans, config(0), tmp_path / "out", first=tmp_path / "alone.safetensors"
        )


def test_an_unprivileged_policy_can_start_from_a_privileged_one(
    trained, plans, tmp_path
):
    """One batch on: counted from there, by Adam too; it must be resumed as it is."""
    other = config(64, privileged=False)
    train_tracker(plans, other, tmp_path, first=trained[0] / "checkpoint.safetensors")
    begun = saved_in(tmp_path)
    assert begun.state["steps"] == 64
    steps = [v for k, v in begun.tensors.items() if k.endswith("/step")]
    assert {float(step) for step in steps} == {4.0}
    actor = load_actor(tmp_path / "policy.safetensors", get_robot("go2"))
    assert not actor.config.privileged
    with pytest.raises(InputError, match="has --privileged False, not True;"):
        train_tracker(plans, config(128), tmp_path, resume=True)


def test_a_training_can_start_with_another_noise_and_hold_it(trained, plans, tmp_path):
    """Only the standard deviation is not that of the networks it starts from."""
    first = trained[0] / "checkpoint.safetensors"
    name, noise = "module/log_std", torch.full((12,), -1.5)
    for steps, learn_std in ((0, True), (64, False), (64, True)):
        out = tmp_path / f"{steps}-{learn_std}"
        other = config(steps, restart_log_std=-1.5, learn_std=learn_std)
        train_tracker(plans, other, out, first=first)
        begun = saved_in(out).tensors
        held = steps == 0 or not learn_std
        assert torch.equal(begun[name], noise) == held
        if steps == 0:
            theirs = saved_in(trained[0]).tensors
            differ = {x for x in begun if x.startswith("module/")}
            differ -= {x for x in differ if torch.equal(begun[x], theirs[x])}
            assert differ == {name}


def test_the_critic_can_learn_first(trained, plans, tmp_path):
    """For two batches the actor is as it was; it learns from the third on."""
    first = trained[0] / "checkpoint.safetensors"
    before = saved_in(trained[0])
    for steps, learns in ((128, False), (192, True)):
        other = config(steps, critic_first=128)
        train_tracker(
            plans, other, tmp_path, resume=learns, first=None if learns else first
        )
        after = saved_in(tmp_path)
        moved = {
            name
            for name, value in before.tensors.items()
            if name.startswith("module/")
            and not torch.equal(value, after.tensors[name])
        }
        assert any("value" in name for name in moved)
        assert any("value" not in name for name in moved) == learns
        if not learns:
            assert after.state["learning_rate"] == before.state["learning_rate"]


def test_a_reward_for_entropy_keeps_noise_up(plans, tmp_path):
    noise = {}
    for entropy in (0.0, 1.0):
        out = tmp_path / str(entropy)
        train_tracker(plans, config(64, entropy=entropy), out)
        noise[entropy] = saved_in(out).tensors["module/log_std"]
    assert (noise[1.0] > noise[0.0]).all()


def test_failures_of_starts_are_resumed(plans, tmp_path):
    """Thrown about by noise, episodes fail; a resumed run knows where."""
    other = config(128, log_std=2.0)
    other.environment.failure_weight = 0.5
    train_tracker(plans, other, tmp_path)
    rates = saved_in(tmp_path).tensors["sampler/failure_rates"]
    assert rates.shape == (2, 4)  # 151 samples
    assert 0 < rates.max() < 1
    train_tracker(plans, other, tmp_path, resume=True)
    assert torch.equal(saved_in(tmp_path).tensors["sampler/failure_rates"], rates)
    other.environment.failure_weight = 0.0
    with pytest.raises(InputError, match=r"has --failure-weight 0.5, not 0.0;"):
        train_tracker(plans, other, tmp_path, resume=True)


def test_other_networks_and_observations_cannot_be_started_from(
    trained, plans, tmp_path
):
    checkpoint, out = trained[0] / "checkpoint.safetensors", tmp_path / "out"
    wide = config(64)
    wide.ppo.hidden = [8, 8]
    with pytest.raises(InputError, match=r"--hidden \[16, 16\], not \[8, 8\]"):
        train_tracker(plans, wide, out, first=checkpoint)
    tensors, header = load_weights(checkpoint, "tracker checkpoint")
    header["run"]["observation_layout"][0][0] = "gravity_W"
    other = tmp_path / "other.safetensors"
    save_weights(other, "tracker checkpoint", tensors, header)
    with pytest.raises(InputError, match="another observation layout"):
        train_tracker(plans, config(64), out, first=other)
    with pytest.raises(InputError, match="not both"):
        train_tracker(plans, config(64), out, resume=True, first=checkpoint)
    assert not out.exists()


def test_checkpoints_of_before_can_be_gone_on_with(trained, plans, tmp_path):
    """As they were written once: "policy", "config", homing; a plan was not drawn."""
    tensors, header = load_weights(trained[0] / CHECKPOINT, "tracker checkpoint")
    old = {name.replace("module/", "policy/"): x for name, x in tensors.items()}
    old["sampler/plan_scores"][0] = torch.nan
    options = dict(header["options"])
    options["environment"]["homing"] = options["environment"].pop("position_penalty")
    config_of_before = {
        "fixed": {"robot": "go2", "hidden": [16, 16], "privileged": True},
        "observation_layout": header["run"]["observation_layout"],
        "training": options,
    }
    path = tmp_path / CHECKPOINT
    header = {"state": header["state"], "config": config_of_before}
    save_weights(path, "tracker checkpoint", old, header)
    figures = train_tracker(plans, config(320), tmp_path, resume=True)
    assert figures["steps"] == 320
    again = saved_in(tmp_path)
    before = saved_in(trained[0])
    assert again.run == before.run
    assert not torch.equal(
        again.tensors["module/log_std"], before.tensors["module/log_std"]
    )


def test_nothing_cannot_be_resumed(plans, tmp_path):
    with pytest.raises(InputError, match="There is no run to resume"):
        train_tracker(plans, config(64), tmp_path / "none", resume=True)
    assert not (tmp_path / "none").exists()


def test_the_position_penalty_is_no_part_of_returns(plans):
    """The same steps are rewarded less, and score the same."""
    rewards, returns = [], []
    for penalty in (0.0, 1.0):
        environment = EnvironmentConfig(position_penalty=penalty, episode_steps=5)
        workers = WorkerVecEnv(
            plans, environment, PlanSampler(plans, 0), workers=1, per_worker=1, seed=0
        )
        try:
            workers.reset()
            for _ in range(5):
                _, reward, _, infos = workers.step(np.zeros((1, 12), dtype=np.float32))
                rewards.append(reward[0])
            returns.append(infos[0]["episode"]["r"])
        finally:
            workers.close()
    assert returns[0] == returns[1] == pytest.approx(20 * sum(rewards[:5]), rel=1e-5)
    assert (np.array(rewards[5:]) < np.array(rewards[:5])).all()


def test_every_other_lost_episode_is_tried_again_from_before_it(plans):
    """With joints thrown about robots fall; what is tried again is not scored."""
    sampler = PlanSampler(plans, 0)
    scored = []
    sampler.record = lambda plan, score, share: scored.append(plan)
    environment = EnvironmentConfig(episode_steps=100)
    workers = WorkerVecEnv(plans, environment, sampler, workers=1, per_worker=8, seed=0)
    random = np.random.default_rng(0)
    retrying, lost, ended, again = [False] * 8, [0] * 8, [], 0
    try:
        workers.reset()
        for _ in range(150):
            actions = random.uniform(-6, 6, (8, 12)).astype(np.float32)
            _, _, dones, infos = workers.step(actions)
            for i in np.flatnonzero(dones):
                if retrying[i]:
                    again += 1
                    assert infos[i]["plan"] == lost[i]
                else:
                    ended.append(infos[i]["plan"])
                assert not (infos[i]["retried"] and infos[i]["TimeLimit.truncated"])
                retrying[i], lost[i] = infos[i]["retried"], infos[i]["plan"]
    finally:
        workers.close()
    assert scored == ended
    assert len(ended) > 20
    assert again / (again + len(ended)) == pytest.approx(0.5, abs=0.15)


def test_the_sampler_prefers_what_lacks_most(plans):
    """Trot at .9 lacks .1, pace at .5 lacks .5: 25 draws in 26 are a pace.

    What lacks more than .8 is drawn as if it lacked .8.
    """
    sampler = PlanSampler(plans, 0)
    sampler.scores[TROT], sampler.scores[PACE] = 0.9, 0.5
    draws = np.array([sampler.draw() for _ in range(3000)])
    share = np.mean([plans[i].labels[0] == PACE for i in draws])
    assert share == pytest.approx(25 / 26, abs=0.01)
    sampler.scores[TROT], sampler.scores[PACE] = 0.2, 0.0
    draws = np.array([sampler.draw() for _ in range(3000)])
    share = np.mean([plans[i].labels[0] == PACE for i in draws])
    assert share == pytest.approx(1 / 2, abs=0.03)


def test_gaits_that_fall_early_still_get_their_steps(plans):
    """Both lack half; trots last a tenth of an episode, so ten are drawn for a pace."""
    sampler = PlanSampler(plans, 0)
    sampler.scores[TROT] = sampler.scores[PACE] = 0.5
    for _ in range(400):
        sampler.record(0, 0.5, 0.1)
        sampler.record(1, 0.5, 1.0)
    draws = np.array([sampler.draw() for _ in range(3000)])
    share = np.mean([plans[i].labels[0] == TROT for i in draws])
    assert share == pytest.approx(10 / 11, abs=0.03)


def test_scores_follow_what_episodes_return(plans):
    sampler = PlanSampler(plans, 0)
    for _ in range(400):
        sampler.record(0, 0.8, 1.0)
    assert sampler.score_by_label()["dog-trot"] == pytest.approx(80, abs=0.1)
    assert sampler.score_by_label()["dog-pace"] == 0.0


def test_within_a_label_the_sampler_prefers_the_plan_that_lacks_most(plans):
    """Of three trots one returns .9, one .5 and one has not been drawn.

    That counts as its label does, .7: shares of .01, .25 and .09, and the pace, as
    good as the label of the trots, gets half of all.
    """
    trot, pace = plans[0], plans[1]
    sampler = PlanSampler([trot, trot, trot, pace], 0)
    sampler.plan_scores[:2] = 0.9, 0.5
    sampler.plan_shares[:2] = 1.0
    sampler.scores[TROT] = sampler.scores[PACE] = 0.7
    counts = np.bincount([sampler.draw() for _ in range(6000)]) / 6000
    trots = 0.5 * np.array([0.01, 0.25, 0.09]) / 0.35
    np.testing.assert_allclose(counts, [*trots, 0.5], atol=0.02)
    assert sampler.score_by_label()["dog-trot"] == pytest.approx(70)


def test_a_plan_is_scored_by_its_last_few_episodes(plans):
    """Its first episode sets the score; the next, of 1, moves it by .4 of the rest."""
    sampler = PlanSampler(plans, 0)
    for score, expected in ((0.5, 0.5), (1.0, 0.7), (1.0, 0.82)):
        sampler.record(0, score, 1.0)
        assert sampler.plan_scores[0] == pytest.approx(expected)
    assert np.isnan(sampler.plan_scores[1:]).all()


def test_an_update_moves_all_that_it_computes_with(plans):
    """To a device without values, which any machine has."""
    workers = WorkerVecEnv(
        plans,
        EnvironmentConfig(),
        PlanSampler(plans, 0),
        workers=1,
        per_worker=2,
        seed=0,
    )
    try:
        learner = make_ppo(workers, PpoConfig(batch=4, minibatch=2, hidden=[8]), 0)
        learner.learn(8)  # gives the optimizer its moments
    finally:
        workers.close()
    meta = torch.device("meta")
    learner._move(meta)
    moments = [
        moment
        for of in learner.policy.optimizer.state.values()
        for name, moment in of.items()
        if name != "step"
    ]
    tensors = [*learner.policy.state_dict().values(), *learner.policy.buffers()]
    assert len(moments) == 2 * len(list(learner.policy.parameters()))
    assert {tensor.device for tensor in (*tensors, *moments)} == {meta}
    assert learner.rollout_buffer.device == learner.policy.device == meta
