import os
import random
import signal
import subprocess
import sys
import threading
import time

import pytest

from loco_drake.common.errors import InputError
from loco_drake.engine.choice import ENGINES, make_executor
from loco_drake.engine.executor import TRIES, WorkerDiedError
from loco_drake.engine.local import Local
from tests.process import HEAR_CTRL_C, LIMIT, processes

_MADE = []


def make_square():
    """Notes that it was called, and returns a function that tells so."""
    _MADE.append(os.getpid())
    return lambda x: (x * x, len(_MADE), os.getpid())


def make_killer():
    return lambda x: os.kill(os.getpid(), signal.SIGKILL)


@pytest.fixture(params=ENGINES)
def engine(request):
    """The name of each engine; that of Ray where it is installed."""
    if request.param == "ray":
        request.getfixturevalue("ray_cluster")
    return request.param


def two_workers(engine):
    return make_executor(engine, 2, None)


def test_results_in_order_and_each_worker_made_its_function_once(engine):
    results = list(two_workers(engine).map(make_square, range(8)))
    assert [square for square, _, _ in results] == [x * x for x in range(8)]
    assert {made for _, made, _ in results} == {1}
    assert os.getpid() not in {pid for _, _, pid in results}


def test_one_local_worker_is_this_process():
    before = len(_MADE)
    results = list(Local(1).map(make_square, range(8)))
    assert {(made - before, pid) for _, made, pid in results} == {(1, os.getpid())}


def test_results_come_one_by_one():
    """Items are not taken from the iterable before their turn."""
    taken = []
    results = Local().map(make_square, (taken.append(i) or i for i in range(9)))
    next(results)
    next(results)
    assert taken == [0, 1]


def test_no_work_is_none(engine):
    assert list(two_workers(engine).map(make_killer, [])) == []


def test_a_worker_that_always_dies_is_an_error_rather_than_a_wait(engine):
    with pytest.raises(WorkerDiedError, match=f"died {TRIES} times at the same task"):
        list(two_workers(engine).map(make_killer, range(3)))


def make_mortal():
    return die_once


def die_once(folder):
    """Returns whether it has died before; the folder remembers."""
    try:
        folder.mkdir()
    except FileExistsError:
        return True
    os.kill(os.getpid(), signal.SIGKILL)
    return False


def test_what_a_dead_worker_did_is_done_again(engine, tmp_path):
    folders = [tmp_path / str(k) for k in range(4)]
    assert list(two_workers(engine).map(make_mortal, folders)) == [True] * 4


def make_slow_square():
    return slow_square


def slow_square(x):
    time.sleep(0.1)
    return x * x


def test_ten_workers_that_are_killed_at_random_cost_nothing(engine):
    """One at a time, whatever it is doing; on a busy machine new ones start slowly."""
    mark = "spawn_main" if engine == "local" else "ray::_Actor"
    chance = random.Random(1)
    done, killed = [], []

    def kill():
        before = -1
        while len(killed) < 10:
            time.sleep(chance.uniform(0.01, 0.3))
            found = [pid for pid, p in processes().items() if mark in p.command]
            if engine == "local":
                own = processes()
                found = [p for p in found if p in own and own[p].parent == os.getpid()]
            found = sorted(set(found) - set(killed))
            if found and len(done) > before:
                before = len(done)
                killed.append(chance.choice(found))
                os.kill(killed[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    for square in two_workers(engine).map(make_slow_square, range(120)):
        done.append(square)  # noqa: PERF402 (the other thread counts them)
    killer.join(timeout=LIMIT)
    assert len(killed) == 10
    assert done == [x * x for x in range(120)]


def make_refusal():
    raise InputError("There is no such thing.")


def make_refuser():
    return refuse


def refuse(x):
    raise InputError(f"Nothing is {x}.")


@pytest.mark.parametrize(
    ("make", "text"),
    [(make_refusal, "^There is no such thing.$"), (make_refuser, "^Nothing is 3.$")],
)
def test_what_a_worker_raises_is_raised_here(engine, make, text):
    with pytest.raises(InputError, match=text):
        list(two_workers(engine).map(make, [3]))


@pytest.mark.parametrize("engine", ENGINES)
def test_no_workers_are_refused(engine):
    if engine == "ray":
        pytest.importorskip("ray")
    with pytest.raises(InputError, match="--workers must be 1 or more"):
        make_executor(engine, 0, None)


def test_engines_are_named():
    with pytest.raises(InputError, match="engine 'slurm'; the choices are local, ray"):
        make_executor("slurm", 1, None)


def test_an_address_needs_ray():
    with pytest.raises(InputError, match="--ray-address needs --engine ray"):
        make_executor("local", 1, "auto")


def test_ray_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.delitem(sys.modules, "loco_drake.engine.cluster", raising=False)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match="install the package ray, the extra 'ray'"):
        make_executor("ray", 1, None)


def make_sleeper():
    return time.sleep


SCRIPT = """
import sys
from loco_drake.engine.choice import make_executor
from tests.engine.test_map import make_sleeper

if __name__ == "__main__":
    executor = make_executor(sys.argv[1], 2, None)
    print("begun", flush=True)
    for k, _ in enumerate(executor.map(make_sleeper, [0.2] * 1000)):
        print("one", flush=True)
"""


@pytest.mark.parametrize(
    ("name", "after"), [("local", "begun"), ("local", "one"), ("ray", "one")]
)
def test_ctrl_c_ends_the_workers(name, after, tmp_path):
    """They are gone soon after, without a traceback of theirs, at work or not yet."""
    if name == "ray":
        pytest.importorskip("ray")
    script = tmp_path / "script.py"
    script.write_text(HEAR_CTRL_C + SCRIPT)
    process = subprocess.Popen(
        [sys.executable, str(script), name],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    while process.stdout.readline() != f"{after}\n":
        pass
    os.killpg(process.pid, signal.SIGINT)
    # The pipes close when the last process that holds them has ended.
    _, errors = process.communicate(timeout=LIMIT)
    assert errors.count("Traceback") == 1
    assert "KeyboardInterrupt" in errors
