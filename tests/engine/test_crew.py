"""Workers that keep a state."""

import os
import signal
import time

import pytest

from loco_drake.common.errors import InputError
from loco_drake.engine.choice import ENGINES, make_executor
from loco_drake.engine.executor import WorkerDiedError
from tests.process import processes


class Counter:
    """Adds up what it is sent; None kills it, and a text is refused."""

    def __init__(self, start):
        self.total = start

    def __call__(self, message):
        if message is None:
            os.kill(os.getpid(), signal.SIGKILL)
        if isinstance(message, str):
            raise InputError(f"Nothing is {message}.")
        self.total += message
        return self.total, os.getpid()


@pytest.fixture(params=ENGINES)
def crew(request):
    """Two counters, from 10 and from 20."""
    if request.param == "ray":
        request.getfixturevalue("ray_cluster")
    crew = make_executor(request.param, 1, None).crew(Counter, [10, 20])
    yield crew
    crew.close()


def ask(crew, worker, message):
    crew.send(worker, message)
    return crew.receive(worker)


def test_each_keeps_a_state_in_a_process_of_its_own(crew):
    for worker in (0, 1):
        crew.send(worker, worker + 1)
    first, second = (crew.receive(worker) for worker in (1, 0))
    assert (first[0], second[0]) == (22, 11)
    assert ask(crew, 0, 5) == (16, second[1])
    assert len({os.getpid(), first[1], second[1]}) == 3


def test_one_that_dies_is_replaced_by_one_that_begins_anew(crew):
    _, pid = ask(crew, 0, 1)
    assert ask(crew, 1, 1)[0] == 21
    with pytest.raises(WorkerDiedError):
        ask(crew, 0, None)
    crew.replace(0)
    total, other = ask(crew, 0, 2)
    assert total == 12
    assert other != pid
    assert ask(crew, 1, 1)[0] == 22


def test_one_that_was_killed_while_idle_is_noticed(crew):
    """Also if several messages were sent to it."""
    _, pid = ask(crew, 1, 1)
    os.kill(pid, signal.SIGKILL)
    for _ in range(2):
        with pytest.raises(WorkerDiedError):
            ask(crew, 1, 1)
    crew.replace(1)
    assert ask(crew, 1, 1)[0] == 21


def test_what_one_raises_is_raised_here_and_it_goes_on(crew):
    with pytest.raises(InputError, match=r"^Nothing is three\.$"):
        ask(crew, 0, "three")
    assert ask(crew, 0, 3)[0] == 13


def test_all_end_when_it_is_closed(crew):
    found = {ask(crew, worker, 0)[1] for worker in (0, 1)}
    crew.close()
    deadline = time.monotonic() + 60
    while found & processes().keys():
        assert time.monotonic() < deadline
        time.sleep(0.02)
