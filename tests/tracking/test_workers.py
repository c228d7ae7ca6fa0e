"""The environments of a training: the same on every engine, whoever dies."""

import os
import signal

import numpy as np
import pytest

from loco_drake.engine.choice import ENGINES, make_executor
from loco_drake.engine.executor import TRIES, Crew, Executor, WorkerDiedError
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.randomization import STANDARD
from loco_drake.tracking.sampler import PlanSampler
from loco_drake.tracking.workers import WorkerVecEnv
from tests.process import processes

WORKERS, PER_WORKER, STEPS = 2, 3, 60


class Here(Executor):
    """Workers that are objects of this process, for quick tests."""

    def map(self, make, items):
        raise NotImplementedError

    def crew(self, make, arguments):
        return HereCrew(make, arguments)


class HereCrew(Crew):
    def __init__(self, make, arguments):
        self.make, self.arguments, self.replaced = make, arguments, 0
        self.members = [make(argument) for argument in arguments]
        self.answers = [None] * len(arguments)
        self.doomed = set()  # workers whose next answer is lost

    def send(self, worker, message):
        self.answers[worker] = self.members[worker](message)

    def receive(self, worker):
        if worker in self.doomed:
            self.doomed.discard(worker)
            raise WorkerDiedError("It died.")
        return self.answers[worker]

    def replace(self, worker):
        self.replaced += 1
        self.members[worker] = self.make(self.arguments[worker])

    def close(self):
        self.members = []


def rollout(plans, config, executor, disturb=lambda workers, step: None, exact=False):
    """Everything that a learner is told in STEPS steps of wild actions."""
    workers = WorkerVecEnv(
        plans,
        config,
        PlanSampler(plans, 0),
        workers=WORKERS,
        per_worker=PER_WORKER,
        seed=0,
        exact=exact,
        executor=executor,
    )
    random = np.random.default_rng(0)
    try:
        told = [workers.reset()]
        for step in range(STEPS):
            disturb(workers, step)
            actions = random.uniform(-4, 4, (WORKERS * PER_WORKER, 12))
            observations, rewards, dones, infos = workers.step(actions.astype("f4"))
            ends = [info["terminal_observation"] for info in infos if info]
            told += [observations, rewards, dones, *ends]
        told.append(workers.reset())
    finally:
        workers.close()
    return told


def check_same(one, other):
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


CONFIGS = {
    "as the model": EnvironmentConfig(episode_steps=25),
    "randomized": EnvironmentConfig(episode_steps=25, randomization=STANDARD),
}


@pytest.fixture(scope="module")
def calm(plans):
    return {name: rollout(plans, c, Here()) for name, c in CONFIGS.items()}


@pytest.mark.parametrize("name", CONFIGS)
def test_workers_that_die_at_random_change_nothing(plans, calm, name):
    """Ten of them, in any step; episodes end in between."""
    random = np.random.default_rng(3)
    when = dict.fromkeys(random.choice(STEPS, 10, replace=False).tolist())
    replaced = []

    def disturb(workers, step):
        if step in when:
            workers._crew.doomed = {int(random.integers(WORKERS))}
        replaced.append(workers._crew.replaced)

    told = rollout(plans, CONFIGS[name], Here(), disturb)
    ends = [x for x in calm[name] if x.dtype == bool]
    assert sum(x.sum() for x in ends) > 5
    assert replaced[-1] >= 9
    check_same(told, calm[name])


def test_exact_observations_survive_too(plans):
    config = CONFIGS["randomized"]

    def disturb(workers, step):
        workers._crew.doomed = {step % 2} if step % 9 == 8 else set()

    told = rollout(plans, config, Here(), disturb, exact=True)
    check_same(told, rollout(plans, config, Here(), exact=True))


def test_a_new_worker_that_dies_too_is_replaced_until_it_is_enough(plans):
    def disturb(workers, step):
        if step == 5:
            workers._crew.receive = died

    def died(worker):
        raise WorkerDiedError("It died.")

    with pytest.raises(WorkerDiedError, match=f"died {TRIES} times at the same step"):
        rollout(plans, CONFIGS["as the model"], Here(), disturb)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_processes_do_the_same_and_may_be_killed(plans, calm, engine, request):
    """By SIGKILL, two of them at once too."""
    if engine == "ray":
        request.getfixturevalue("ray_cluster")
    mark = "spawn_main" if engine == "local" else "ray::_Actor"
    killed = []

    def disturb(workers, step):
        if step not in (20, 40):
            return
        found = [
            pid
            for pid, process in processes().items()
            if mark in process.command
            and (engine == "ray" or process.parent == os.getpid())
        ]
        assert len(found) == WORKERS
        for pid in found[: step // 20]:
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    told = rollout(
        plans, CONFIGS["randomized"], make_executor(engine, 1, None), disturb
    )
    assert len(killed) == 3
    check_same(told, calm["randomized"])
