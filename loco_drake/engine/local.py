"""Workers that are processes of this machine."""

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from loco_drake.engine.executor import (
    TRIES,
    Crew,
    Executor,
    Function,
    Item,
    Result,
    WorkerDiedError,
    gave_up,
)

# Fork would copy the threads' locks of torch and Drake.
_SPAWN = multiprocessing.get_context("spawn")

# The function of this worker process.
_function: Callable[[Any], Any]


@dataclass(frozen=True)
class Local(Executor):
    """Processes of this machine; one worker of :meth:`map` is this process itself."""

    def map(
        self, make: Callable[[], Callable[[Item], Result]], items: Iterable[Item]
    ) -> Iterator[Result]:
        """Yields the result for each item; see :meth:`.Executor.map`."""
        if self.workers == 1:
            yield from map(make(), items)
            return
        tasks, first, tries = list(items), 0, 0
        done: dict[int, Future[Result]] = {}
        while first < len(tasks):
            with _pool(make, self.workers) as pool:
                begun: dict[int, Future[Result]] = {}
                try:
                    with _deaf_to_ctrl_c():
                        for i in range(first, len(tasks)):
                            begun[i] = done.get(i) or pool.submit(_call, tasks[i])
                    while first < len(tasks):
                        result = begun.pop(first).result()
                        first, tries = first + 1, 0
                        yield result
                except BrokenProcessPool:
                    # One that dies takes the pool with it.
                    tries += 1
                    if tries == TRIES:
                        raise gave_up() from None
                    done = {
                        i: future for i, future in begun.items() if _is_done(future)
                    }

    def crew(
        self, make: Callable[[Any], Callable[[Any], Any]], arguments: Sequence[Any]
    ) -> "LocalCrew":
        """Returns processes that keep a state; see :meth:`.Executor.crew`."""
        return LocalCrew(make, arguments)


LOCAL = Local()  # without any worker process


@contextmanager
def _pool(
    make: Callable[[], Callable[[Any], Any]], workers: int
) -> Iterator[ProcessPoolExecutor]:
    pool = ProcessPoolExecutor(
        max_workers=workers,
        mp_context=_SPAWN,
        initializer=_start,
        initargs=(make,),
    )
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """Starts processes that Ctrl-C does not reach: only this one is to handle it.

    It reaches the whole process group, but they inherit that it is blocked.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class LocalCrew(Crew):
    """Processes with a pipe each."""

    def __init__(
        self, make: Callable[[Any], Callable[[Any], Any]], arguments: Sequence[Any]
    ) -> None:
        self._make, self._arguments = make, arguments
        self._members = [self._start(k) for k in range(len(arguments))]

    def _start(self, worker: int) -> tuple[SpawnProcess, Connection]:
        ours, theirs = _SPAWN.Pipe()
        make = partial(self._make, self._arguments[worker])
        process = _SPAWN.Process(target=_serve, args=(theirs, make), daemon=True)
        with _deaf_to_ctrl_c():
            process.start()
        theirs.close()
        return process, ours

    def send(self, worker: int, message: Any) -> None:
        """Sends a message; see :meth:`.Crew.send`."""
        with suppress(OSError):  # a broken pipe, which receive tells of
            self._members[worker][1].send(message)

    def receive(self, worker: int) -> Any:
        """Returns the answer; see :meth:`.Crew.receive`."""
        try:
            answer, error = self._members[worker][1].recv()
        except (EOFError, ConnectionError):
            raise WorkerDiedError("A worker process died.") from None
        if error is not None:
            raise error
        return answer

    def replace(self, worker: int) -> None:
        """Starts a new process; see :meth:`.Crew.replace`."""
        process, pipe = self._members[worker]
        pipe.close()
        process.kill()
        process.join()
        self._members[worker] = self._start(worker)

    def close(self) -> None:
        """Ends the processes."""
        for _, pipe in self._members:
            pipe.close()
        for process, _ in self._members:
            process.join(timeout=5)
            if process.is_alive():
                process.kill()
        self._members = []


def _serve(pipe: Connection, make: Callable[[], Callable[[Any], Any]]) -> None:
    """Answers messages until the other end of the pipe is closed."""
    function = Function(make)
    with suppress(EOFError, ConnectionError):
        while True:
            pipe.send(_answer(function, pipe.recv()))


def _answer(function: Function, message: Any) -> tuple[Any, Exception | None]:
    """Returns what the function returns, and what it raises."""
    try:
        return function(message), None
    except Exception as error:
        return None, error


def _is_done(future: "Future[Any]") -> bool:
    return future.done() and not future.cancelled() and future.exception() is None


def _start(make: Callable[[], Callable[[Any], Any]]) -> None:
    global _function
    _function = Function(make)


def _call(item: Any) -> Any:
    return _function(item)
