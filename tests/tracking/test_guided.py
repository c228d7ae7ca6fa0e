"""Guided policy search: laws along what a policy does, and learning them."""

import json
import shutil
import signal
from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.control.actor_file import load_actor, read_actor, save_actor
from loco_drake.control.observation import observe, preview
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import VELOCITY, split
from loco_drake.engine.local import Local
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.tracking.config import ResetNoise
from loco_drake.tracking.guidance import find_law
from loco_drake.tracking.guided_config import GuidedConfig, IlqrConfig, StretchConfig
from loco_drake.tracking.joining import near_of
from loco_drake.tracking.law_learning import learn_laws
from loco_drake.tracking.laws import Laws, law_loss, load_found, save_found
from loco_drake.tracking.problem import TrackingProblem
from loco_drake.tracking.train_guided import train_guided
from loco_drake.tracking.visited import visit

START = pretrained_path("policy_go2")
SHORT = StretchConfig(length=34, tail=4, lead=3, ilqr=IlqrConfig(iterations=1, steps=1))


def config(steps, **options):
    small = {"stretches": 2, "updates": 40, "minibatch": 64, "workers": 1}
    return GuidedConfig(**{"steps": steps, "stretch": SHORT, **small, **options})


@pytest.fixture(scope="module")
def near():
    return near_of(load_actor(START, get_robot("go2"))).requires_grad_(False)


@pytest.fixture(scope="module")
def found(plans, near):
    return find_law(plans, near, config(1).environment, SHORT, (0, 0, 1))


@pytest.fixture(scope="module")
def trained(plans, tmp_path_factory):
    """Ctrl-C after the first of two rounds, and resumed."""
    folder = tmp_path_factory.mktemp("guided")

    def interrupt(steps, scores):
        signal.raise_signal(signal.SIGINT)

    first = train_guided(plans, START, config(2), folder, report=interrupt)
    second = train_guided(plans, None, config(2), folder, resume=True)
    return folder, first, second


def test_a_law_costs_less_and_leads_where_it_says(found, plans):
    assert len(found.law) <= 30
    assert found.law.reward > found.before
    problem = TrackingProblem(plans[found.plan], config(1).environment)
    state = found.law.states[0]
    for t, before in enumerate(found.law.before()):
        action = found.law.actions[t]
        state = problem.next_state(found.sample + t + 1, state, action, before)
        assert (state == found.law.states[t + 1]).all()
    eigenvalues = np.linalg.eigvalsh(found.law.curvatures)
    assert (eigenvalues > 0).all()


def test_the_same_seed_finds_the_same_law(found, plans, near):
    again = find_law(plans, near, config(1).environment, SHORT, (0, 0, 1))
    assert (again.law.gains == found.law.gains).all()
    other = find_law(plans, near, config(1).environment, SHORT, (0, 0, 2))
    assert (other.plan, other.sample) != (found.plan, found.sample)


def test_a_policy_that_falls_at_once_has_no_law(plans, near):
    wild = near_of(near)
    with torch.no_grad():
        wild.layers[-1].bias += 20.0
    assert find_law(plans, wild, config(1).environment, SHORT, (0, 0, 1)) is None


def test_a_push_changes_the_velocity_at_the_start(plans, near):
    still = ResetNoise(joints=0, velocities=0, position=0, heading=0)
    world = replace(config(1).environment, reset_noise=still)
    pushed = replace(SHORT, lead_share=0.0, push=(0.5, 0.7))
    found = find_law(plans, near, world, pushed, (0, 0, 3))
    change = found.law.states[0] - plans[found.plan].state[found.sample]
    velocity = split(change)[1][VELOCITY]
    assert velocity[2] == 0
    assert 0.5 <= np.linalg.norm(velocity) <= 0.7
    change[22:25] = 0
    assert not change.any()


def test_what_a_push_throws_is_saved_and_goes_on(plans, near):
    hard = replace(SHORT, length=50, lead_share=0.0, push=(1.6, 1.6))
    world = config(1).environment
    lost = find_law(plans, near, world, replace(hard, rescues=0), (0, 0, 6))
    assert lost is None
    saved = find_law(plans, near, world, hard, (0, 0, 6))
    assert len(saved.law) == 46
    plan, row = plans[saved.plan], saved.sample
    problem = TrackingProblem(plan, world)
    rewards = problem.rewards(row + 1, saved.law.states[1:])
    assert saved.before < 0.4
    assert rewards[-5:].mean() > 0.6  # it comes back to its plan


def test_law_files_hold_32_bits(found, tmp_path):
    path = tmp_path / "law.safetensors"
    save_found(path, found)
    read = load_found(path)
    names = ("plan", "sample", "before", "periods")
    assert all(getattr(read, name) == getattr(found, name) for name in names)
    assert read.law.gains == pytest.approx(found.law.gains, rel=1e-6)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError):
        load_found(path)


def test_what_a_law_tells_on_its_trajectory_and_beside_it(found, plans, monkeypatch):
    robot, plan = get_robot("go2"), plans[found.plan]
    laws = Laws(robot, plans, 1000)
    laws.add(found)
    monkeypatch.setattr(laws, "_spread", 0 * laws._spread)
    monkeypatch.setattr("loco_drake.tracking.laws._ACTION_SPREAD", 0.0)
    seen, told, weights = laws.draw(np.random.default_rng(0), 50)
    rows = {tuple(action): i for i, action in enumerate(told.numpy().round(5))}
    before = found.law.before()
    for t, action in enumerate(found.law.actions):
        i = rows.get(tuple(action.astype(np.float32).round(5)))
        if i is None:
            continue
        shown = preview(plan, (found.sample + t) * PLAN_DT)
        wanted = observe(robot, shown, found.law.states[t], before[t])
        assert seen[i].numpy() == pytest.approx(wanted, abs=1e-5)
    assert len(rows) > 15
    # Of all weights the mean of the diagonal is 1.
    assert float(torch.diagonal(weights, dim1=1, dim2=2).mean()) == pytest.approx(
        1, abs=0.2
    )
    monkeypatch.setattr("loco_drake.tracking.laws._ACTION_SPREAD", 1e-3)
    shift = np.random.default_rng(1)
    _, moved, _ = laws.draw(shift, 50)
    repeat = np.random.default_rng(1)
    index = repeat.integers(len(found.law), size=50)
    share = repeat.random((50, 1))
    repeat.standard_normal((50, 36))
    off = share * 1e-3 * repeat.standard_normal((50, 12))
    wanted = found.law.actions[index] + np.einsum(
        "nij,nj->ni", found.law.gains[index][:, :, 36:], off
    )
    assert moved.numpy() == pytest.approx(wanted, abs=1e-5)


def test_the_oldest_laws_go(found, plans):
    laws = Laws(get_robot("go2"), plans, 2 * len(found.law))
    for _ in range(5):
        laws.add(found)
    assert len(laws) == 2 * len(found.law)


def test_loss_weighs_what_actions_cost():
    told = torch.zeros(1, 2)
    weights = torch.diag(torch.tensor([4.0, 1.0]))[None]
    losses = [
        float(law_loss(torch.tensor([action]), told, weights))
        for action in ([0.1, 0.0], [0.0, 0.1], [100.0, 0.0])
    ]
    # e' W e / 2 where errors are small, and 2 sqrt(e' W e / 2) where they are large.
    assert losses[:2] == pytest.approx([0.02, 0.005], rel=0.02)
    assert losses[2] == pytest.approx(2 * np.sqrt(2e4), rel=0.02)


def test_it_learns(trained):
    folder, first, second = trained
    assert (first["steps"], first["interrupted"]) == (1, True)
    assert (second["steps"], second["interrupted"]) == (2, False)
    text = (folder / "progress.jsonl").read_text()
    lines = [json.loads(line) for line in text.splitlines()]
    assert [line["round"] for line in lines] == [1, 2]
    # Of each of the four laws: 34 periods of the policy, some of them twice, 97 of
    # each that is linearized, and up to 24 runs of the law.
    periods = second["periods"]
    assert periods == lines[-1]["steps"]
    assert 4 * 31 * 98 < periods < 4 * 37 * (98 + 25)
    start, learner = read_actor(START)
    now, kept = read_actor(folder / "policy.safetensors")
    assert all((learner[name] == kept[name]).all() for name in learner)
    for name, value in now.state_dict().items():
        same = torch.equal(value, start.state_dict()[name])
        assert same != name.startswith("layers."), name


def test_the_network_that_acts_far_away_learns(plans, tmp_path):
    far = config(1, learns="far", stretch=replace(SHORT, push=(0.5, 1.0)))
    train_guided(plans, START, far, tmp_path)
    start, _ = read_actor(START)
    now, _ = read_actor(tmp_path / "policy.safetensors")
    for name, value in now.state_dict().items():
        same = torch.equal(value, start.state_dict()[name])
        assert same != name.startswith("recovery."), name


def test_a_policy_keeps_what_it_does_where_it_gets_to(plans, found):
    far = {"learns": "far", "stretch": replace(SHORT, lead_share=0.5, push=(0.6, 0.6))}
    changes = []
    for keep in (0.0, 100.0):
        options = config(1, keep=keep, kept_stretches=3, updates=60, **far)
        policy = load_actor(START, get_robot("go2")).requires_grad_(False)
        laws = Laws(get_robot("go2"), plans, 1000)
        laws.add(found)
        random = np.random.default_rng((0, 0, 1))
        seen = visit(plans, policy, options.environment, options.stretch, random, 3)
        assert 34 < len(seen) <= 3 * 34
        before = policy(seen)
        learn_laws(policy, laws, plans, options, 0)
        changes.append(float((policy(seen) - before).square().mean()))
    assert changes[1] < changes[0] / 4


class Interrupted(Local):
    """Is stopped after the first stretch."""

    def map(self, make, items):
        for one in super().map(make, items):
            signal.raise_signal(signal.SIGINT)
            yield one


def test_interruptions_change_nothing(trained, plans, tmp_path):
    first = train_guided(plans, START, config(2), tmp_path, executor=Interrupted())
    assert (first["steps"], first["interrupted"]) == (0, True)
    assert len(list((tmp_path / "laws" / "001").iterdir())) == 1
    train_guided(plans, None, config(2), tmp_path, resume=True)
    one, other = (
        read_actor(path / "policy.safetensors")[0].state_dict()
        for path in (tmp_path, trained[0])
    )
    assert all((one[name] == other[name]).all() for name in one)


def test_a_policy_that_finds_no_law_is_refused(plans, tmp_path):
    wild, path = load_actor(START, get_robot("go2")), tmp_path / "wild.safetensors"
    with torch.no_grad():
        wild.layers[-1].bias += 20.0
        wild.recovery[-1].bias += 20.0
    save_actor(wild, path)
    with pytest.raises(InputError, match="No law was found"):
        train_guided(plans, path, config(1), tmp_path / "run")


def test_laws_that_are_gone_or_half_written(trained, plans, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)
    laws = folder / "laws" / "002"
    (laws / ".00007.safetensors").write_bytes(b"half")  # by a kill
    train_guided(plans, None, config(2), folder, resume=True)
    next(laws.glob("0*")).unlink()
    with pytest.raises(InputError, match="has 1 laws, not the 2 of the run"):
        train_guided(plans, None, config(2), folder, resume=True)


def test_what_cannot_be_trained(plans, near, tmp_path):
    student = pretrained_path("policy_go2_unprivileged")
    with pytest.raises(InputError, match="has a memory, and learns no laws"):
        train_guided(plans, student, config(1), tmp_path / "a")
    with pytest.raises(InputError, match="another robot: a1, not go2"):
        train_guided(plans, pretrained_path("policy_a1"), config(1), tmp_path / "a")
    longer = config(1, stretch=replace(SHORT, length=200, tail=140))
    with pytest.raises(InputError, match=r"No motion has the 167 samples of 0\.02 s"):
        train_guided(plans, START, longer, tmp_path / "a")
    with pytest.raises(InputError, match="--seed must be 0 or more"):
        train_guided(plans, START, config(1, seed=-1), tmp_path / "a")
    with pytest.raises(InputError, match="length must be 29 or more"):
        train_guided(
            plans, START, config(1, stretch=replace(SHORT, length=20)), tmp_path / "a"
        )
    single = tmp_path / "near.safetensors"
    save_actor(near, single)
    with pytest.raises(InputError, match="no second network, far from the plan"):
        train_guided(plans, single, config(1, learns="far"), tmp_path / "a")
    with pytest.raises(InputError, match="--keep must be 0 or more"):
        train_guided(plans, START, config(1, keep=-1.0), tmp_path / "a")
    for push, message in (
        ((-1.0, 1.0), "push must be 0 or more"),
        ((2.0, 1.0), "push must be 2 or more and at most 5, not 1"),
        ((1.0, np.inf), "push must be 1 or more and at most 5, not inf"),
    ):
        pushed = config(1, stretch=replace(SHORT, push=push))
        with pytest.raises(InputError, match=message):
            train_guided(plans, START, pushed, tmp_path / "a")
    assert not (tmp_path / "a").exists()
