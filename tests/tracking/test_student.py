"""A student learns from a teacher what it can do without privileged observations."""

import json
import signal

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.run_folder import read_checkpoint
from loco_drake.control.actor import mirror_actions
from loco_drake.control.actor import mirror_observations as mirror
from loco_drake.control.actor_file import load_actor
from loco_drake.control.history import remember
from loco_drake.control.history_actor import HistoryActor
from loco_drake.control.observation import OBSERVATION_SIZE, PLACES
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.tracking.config import EnvironmentConfig, StudentConfig
from loco_drake.tracking.randomization import RandomizationConfig
from loco_drake.tracking.replay import Replay
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.student import Dagger, make_student
from loco_drake.tracking.train_student import train_student
from loco_drake.tracking.workers import WorkerVecEnv

TEACHER = pretrained_path("policy_go2")
CHECKPOINT = "checkpoint.safetensors"


def config(steps, **options):
    # Noise alone needs no worlds of their own.
    world = RandomizationConfig(noise=1.0)
    environment = EnvironmentConfig(episode_steps=40, randomization=world)
    small = {"batch": 256, "minibatch": 256, "updates": 12, "capacity": 2048}
    return StudentConfig(
        **{"steps": steps, "workers": 1, "per_worker": 4, **small, **options},
        history=4,
        environment=environment,
    )


def saved_in(folder):
    return read_checkpoint(folder / CHECKPOINT, "student")


@pytest.fixture(scope="module")
def teacher():
    return load_actor(TEACHER, get_robot("go2")).requires_grad_(False)


@pytest.fixture(scope="module")
def trained(plans, tmp_path_factory):
    """Four batches, then Ctrl-C in the fifth, then four more."""
    folder = tmp_path_factory.mktemp("student")

    def interrupt(steps, scores):
        if steps >= 1024:
            signal.raise_signal(signal.SIGINT)

    first = train_student(plans, TEACHER, config(2048), folder, report=interrupt)
    stopped = saved_in(folder)
    second = train_student(plans, TEACHER, config(2048), folder, resume=True)
    return folder, first, stopped, second, saved_in(folder)


@pytest.mark.slow
def test_a_student_learns_from_its_teacher(trained):
    """What it estimates comes closer to the truth, while the teacher hands over."""
    lines = (trained[0] / "progress.jsonl").read_text().splitlines()
    first, *_, last = (json.loads(line) for line in lines)
    assert [json.loads(line)["steps"] for line in lines] == list(range(256, 2049, 256))
    assert last["train/velocity_error"] < 0.8 * first["train/velocity_error"]
    assert last["train/height_error"] < first["train/height_error"]
    assert first["train/teacher_share"] == 1
    assert last["train/teacher_share"] == 0
    assert last["train/learning_rate"] < 0.1 * first["train/learning_rate"]
    assert list(trained[0].glob("events.out.tfevents.*"))


@pytest.mark.slow
def test_the_student_comes_to_do_what_the_teacher_would(teacher, plans):
    """On the samples of one batch, from which it learns again and again."""
    own = config(256)
    dagger = Dagger(make_student(teacher, 4, ["dog-trot"]), teacher, own)
    workers = WorkerVecEnv(
        plans,
        own.environment,
        PlanSampler(plans, 0),
        workers=1,
        per_worker=4,
        seed=0,
        exact=True,
    )
    try:
        dagger.begin(workers)
        dagger.collect(workers, share=0.5)
    finally:
        workers.close()
    first, *_, last = [dagger.learn(rate=1e-3) for _ in range(6)]
    for name in ("action", "velocity", "height"):
        assert getattr(last, name) < 0.8 * getattr(first, name), name


@pytest.mark.slow
def test_an_interrupted_training_goes_on_to_the_end(trained, plans, tmp_path):
    """Adam counts the updates of all batches; nothing left to do changes nothing."""
    folder, first, stopped, second, ended = trained
    assert first["interrupted"]
    assert first["steps"] == stopped.state["steps"] == 1024
    assert not second["interrupted"]
    assert second["steps"] == ended.state["steps"] == 2048
    counts = [v for k, v in ended.tensors.items() if k.endswith("/step")]
    assert {float(count) for count in counts} == {8 * 12.0}
    (tmp_path / CHECKPOINT).write_bytes((folder / CHECKPOINT).read_bytes())
    train_student(plans, TEACHER, config(2048), tmp_path, resume=True)
    again = saved_in(tmp_path)
    assert again.state == ended.state
    for name, value in ended.tensors.items():
        torch.testing.assert_close(
            again.tensors[name], value, rtol=0, atol=0, equal_nan=True
        )


@pytest.mark.slow
def test_the_trained_policy_is_symmetric_and_has_a_history(trained):
    student = load_actor(trained[0] / "policy.safetensors", get_robot("go2"))
    assert isinstance(student, HistoryActor)
    assert not student.config.privileged
    assert student.config.labels == ["dog-pace", "dog-trot"]
    seen = torch.randn(3, OBSERVATION_SIZE)
    with torch.inference_mode():
        assert torch.equal(student(mirror(seen)), mirror_actions(student(seen)))


@pytest.mark.slow
def test_a_run_is_neither_overwritten_nor_gone_on_with_otherwise(trained, plans):
    folder = trained[0]
    with pytest.raises(InputError, match="holds a run already"):
        train_student(plans, TEACHER, config(2048), folder)
    with pytest.raises(InputError, match="has --updates 12, not 6"):
        train_student(plans, TEACHER, config(2048, updates=6), folder, resume=True)


def test_who_cannot_teach_is_refused(plans, tmp_path):
    out = tmp_path / "out"
    a1, other = config(64), pretrained_path("policy_a1_unprivileged")
    a1.environment.robot = "a1"
    with pytest.raises(InputError, match="for another robot: go2, not a1"):
        train_student(plans, TEACHER, a1, out)
    with pytest.raises(InputError, match="cannot teach: it has no privileged"):
        train_student(plans, other, a1, out)
    assert not out.exists()


def test_the_teacher_is_told_where_the_student_believes_to_be(teacher):
    """Where the robot really is makes no difference; its velocity and height do."""
    dagger = Dagger(make_student(teacher, 4, ["dog-trot"]), teacher, config(64))
    random = torch.Generator().manual_seed(0)
    # Near what the teacher knows, so that nothing is clipped.
    noise = 0.3 * torch.randn(4, OBSERVATION_SIZE, generator=random)
    exact = teacher.mean + noise * teacher.variance.sqrt()
    asked, offset = dagger._ask(exact, exact)
    assert (offset == 0).all()
    moved = exact.clone()
    plan_p_H = moved[:, PLACES["plan_p_H"]].view(4, 4, 3)
    plan_p_H[..., :2] += torch.tensor([0.4, -0.3])
    torch.testing.assert_close(dagger._ask(exact, moved)[0], asked, atol=1e-5, rtol=0)
    for name in ("v_WB_H", "height"):
        other = exact.clone()
        other[:, PLACES[name]] += 0.05
        assert (dagger._ask(exact, other)[0] - asked).abs().max() > 1e-3
    # It says how to come back from where the student believes to be.
    dagger._memory[:, :3] = torch.tensor([1.0, 0.1, 0.0])
    back, offset = dagger._ask(exact, exact)
    torch.testing.assert_close(offset, torch.tensor([[0.1, 0.0]] * 4))
    assert (back - asked).abs().max() > 1e-3


def test_what_is_replayed_is_what_the_student_remembered():
    """Also over the end of the buffer, and from the start of an episode."""
    random = np.random.default_rng(0)
    replay = Replay(robots=2, history=3, capacity=24)
    size = 3 + 3 * (remember_size := 73)
    memory, ages = torch.zeros(2, size), np.zeros(2, dtype=np.int64)
    remembered = {}
    for n in range(40):
        seen = torch.from_numpy(random.standard_normal((2, OBSERVATION_SIZE))).float()
        key = torch.tensor([[n, robot] for robot in range(2)]).float()
        remembered |= {(n, i): (seen[i], memory[i], ages[i]) for i in range(2)}
        replay.add(
            ages,
            observation=seen,
            offset=memory[:, 1:3],
            action=torch.zeros(2, 12),
            truth=torch.cat((key, key), dim=-1),
        )
        memory = remember(seen, memory, torch.zeros(2, 3))
        ended = random.random(2) < 0.2
        memory, ages = memory * torch.from_numpy(~ended)[:, None], ages + 1
        ages[ended] = 0
        ages = ages.copy()
    drawn = replay.draw(random, 200)
    keys = {(int(n), int(i)) for n, i in drawn["truth"][:, :2]}
    # Of twelve kept rows the oldest three only serve the others.
    assert keys == {(n, i) for n in range(31, 40) for i in range(2)}
    frames = slice(size - 3 * remember_size, None)
    begun = 0
    for k, (n, i) in enumerate(drawn["truth"][:, :2].int().tolist()):
        seen, memory, age = remembered[n, i]
        assert torch.equal(drawn["observation"][k], seen)
        if age > 0:
            begun += 1
            assert torch.equal(drawn["memory"][k, frames], memory[frames])
            assert torch.equal(drawn["memory"][k, 1:3], memory[1:3])
    assert 0 < begun < 200


def test_workers_give_the_exact_observation_beside_the_measured_one(plans):
    seen = {}
    for noise in (None, 1.0):
        world = RandomizationConfig(noise=noise)
        environment = EnvironmentConfig(randomization=world)
        workers = WorkerVecEnv(
            plans,
            environment,
            PlanSampler(plans, 0),
            workers=1,
            per_worker=2,
            seed=0,
            exact=True,
        )
        try:
            both = workers.reset()
            assert both.shape[1:] == workers.observation_space.shape
            seen[noise] = np.split(both, 2, axis=1)
        finally:
            workers.close()
    np.testing.assert_array_equal(*seen[None])
    measured, exact = seen[1.0]
    np.testing.assert_array_equal(exact, seen[None][1])
    assert 0.01 < np.abs(measured - exact).std() < 0.2
