import os
import signal
import subprocess
import sys
import time

import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.parallel import map_in_workers
from tests.process import HEAR_CTRL_C, LIMIT

_MADE = []


def make_square():
    """Notes that it was called, and returns a function that tells so."""
    _MADE.append(os.getpid())
    return lambda x: (x * x, len(_MADE), os.getpid())


def make_killer():
    return lambda x: os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("workers", [1, 2])
def test_results_in_order_and_each_worker_made_its_function_once(workers):
    before = len(_MADE)
    results = list(map_in_workers(make_square, range(8), workers))
    assert [square for square, _, _ in results] == [x * x for x in range(8)]
    made_here = before if workers == 1 else 0
    assert {made - made_here for _, made, _ in results} == {1}
    here = os.getpid() in {pid for _, _, pid in results}
    assert here == (workers == 1)


def test_results_come_one_by_one():
    """Items are not taken from the iterable before their turn."""
    taken = []
    results = map_in_workers(make_square, (taken.append(i) or i for i in range(9)), 1)
    next(results)
    next(results)
    assert taken == [0, 1]


def test_a_killed_worker_is_an_error_rather_than_a_wait():
    with pytest.raises(ChildProcessError, match="worker process died"):
        list(map_in_workers(make_killer, range(3), 2))


def test_no_workers_are_refused():
    with pytest.raises(InputError, match="--workers must be 1 or more"):
        map_in_workers(make_square, [], 0)


def make_sleeper():
    return time.sleep


SCRIPT = """
from loco_drake.common.parallel import map_in_workers
from tests.common.test_parallel import make_sleeper
def items():
    yield from [0.2] * 1000
    print("started", flush=True)

if __name__ == "__main__":
    for _ in map_in_workers(make_sleeper, items(), 2):
        print("one", flush=True)
"""


@pytest.mark.parametrize("after", ["started", "one"])
def test_ctrl_c_ends_the_workers(after, tmp_path):
    """Both are gone soon after, without a traceback of theirs, at work or not yet."""
    script = tmp_path / "script.py"
    script.write_text(HEAR_CTRL_C + SCRIPT)
    process = subprocess.Popen(
        [sys.executable, str(script)],
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
