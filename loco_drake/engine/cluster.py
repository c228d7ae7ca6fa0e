"""Workers on the machines of a Ray cluster, one processor core for each."""

import os
import platform
import socket
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from loco_drake.common.errors import InputError, quoted
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

try:
    import ray
    from ray.exceptions import RayError, RayTaskError
except ImportError:
    raise InputError(
        "To run on a Ray cluster, install the package ray, the extra 'ray' of "
        "loco_drake, or leave out --engine ray."
    ) from None

PATIENCE = 600.0  # s for actors to start in

# What the last bits of results depend on.
_PACKAGES = ("loco_drake", "drake", "numpy", "scipy", "torch")


@dataclass(frozen=True)
class Ray(Executor):
    """Actors on a Ray cluster.

    It is connected to when the first work is given, unless this process is connected to
    one already, and left when the process ends.

    Raises:
        InputError: when work is given, if no cluster answers, it has fewer cores than
            workers are wanted, or a machine of it has other versions of the packages
            than this one, or lacks the present folder.
    """

    # Of the cluster, such as "auto" or "HOST:6379". None: $RAY_ADDRESS, else a cluster
    # of this process's own, on this machine.
    address: str | None = None

    def map(
        self, make: Callable[[], Callable[[Item], Result]], items: Iterable[Item]
    ) -> Iterator[Result]:
        """Yields the result for each item; see :meth:`.Executor.map`.

        Whichever actor is free takes the next item. One that cannot be started, since
        its cluster has shrunk, leaves the items to the others.
        """
        tasks = list(items)
        if not tasks:
            return
        count = min(self.workers, len(tasks))
        starter = self.starter(make, count)
        actors: list[Any] = []
        todo = deque((i, 1) for i in range(len(tasks)))  # index, which try
        done: dict[int, Result] = {}
        # What is to come, from whom, and for which task; None: that it has started.
        coming: dict[Any, tuple[Any, tuple[int, int] | None]] = {}
        first, failed_starts = 0, 0

        def start() -> None:
            actors.append(starter())
            coming[actors[-1].ready.remote()] = actors[-1], None

        try:
            for _ in range(count):
                start()
            while first < len(tasks):
                (reference,), _ = ray.wait(list(coming))
                actor, task = coming.pop(reference)
                try:
                    result = get(reference)
                except RayError as error:  # the actor, or its machine, is gone
                    failed_starts = failed_starts + 1 if task is None else 0
                    if failed_starts == TRIES:
                        raise _died(error) from None
                    if task is not None and task[1] == TRIES:
                        raise gave_up() from None
                    if task is not None:
                        todo.appendleft((task[0], task[1] + 1))
                    start()
                    continue
                if task is not None:
                    done[task[0]] = result
                if todo:
                    task = todo.popleft()
                    coming[actor.call.remote(tasks[task[0]])] = actor, task
                else:
                    ray.kill(actor)
                while first in done:
                    yield done.pop(first)
                    first += 1
        finally:
            busy = [x for x, (_, task) in coming.items() if task is not None]
            if busy:
                ray.wait(busy, num_returns=len(busy))
            for actor in actors:
                ray.kill(actor)

    def crew(
        self, make: Callable[[Any], Callable[[Any], Any]], arguments: Sequence[Any]
    ) -> "RayCrew":
        """Returns actors that keep a state; see :meth:`.Executor.crew`."""
        start = self.starter(make, len(arguments))
        return RayCrew([partial(start, argument) for argument in arguments])

    def starter(
        self, make: Callable[[Any], Any] | Callable[[], Any], count: int
    ) -> Callable[..., Any]:
        """Returns a function that starts an actor, given what ``make`` takes.

        Raises:
            InputError: see :class:`Ray`.
        """
        self._connect()
        cores = int(ray.cluster_resources().get("CPU", 0))
        if cores < count:
            raise InputError(
                f"--workers must be at most {cores}, the cores of the Ray cluster, not "
                f"{count}."
            )
        here = ray.put((make, _versions(), str(Path.cwd())))
        return lambda *arguments: _REMOTE_ACTOR.remote(here, *arguments)

    def _connect(self) -> None:
        if ray.is_initialized():
            return
        address = self.address or os.environ.get("RAY_ADDRESS") or "local"
        own: dict[str, Any] = {}
        if address == "local":
            os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
            cores = max(self.workers, os.cpu_count() or 1)
            own = {"num_cpus": cores, "include_dashboard": False}
        host, _, port = address.rpartition(":")
        try:
            if host and "/" not in host:  # Ray would try for minutes
                socket.create_connection((host, int(port)), timeout=10).close()
            ray.init(address, log_to_driver=False, logging_level="ERROR", **own)
        except Exception as error:  # Ray raises many kinds
            if own:
                raise OSError(f"Ray does not start on this machine: {error}") from None
            reason = str(error).strip().partition("\n")[0]
            raise InputError(
                f"There is no Ray cluster at {quoted(address)} ({reason}); begin one "
                "there with `ray start --head`, or leave out --ray-address."
            ) from None


class RayCrew(Crew):
    """Actors, given the functions that start them.

    Raises:
        WorkerDiedError: if there are too few free cores for them.
    """

    def __init__(self, start: Sequence[Callable[[], Any]]) -> None:
        self._start = start
        self._actors = [begin() for begin in start]
        self._answers: list[Any] = [actor.ready.remote() for actor in self._actors]
        _await_start(self._answers)

    def send(self, worker: int, message: Any) -> None:
        """Sends a message; see :meth:`.Crew.send`."""
        self._answers[worker] = self._actors[worker].call.remote(message)

    def receive(self, worker: int) -> Any:
        """Returns the answer; see :meth:`.Crew.receive`."""
        try:
            return get(self._answers[worker])
        except RayError as error:
            raise _died(error) from None

    def replace(self, worker: int) -> None:
        """Starts a new actor, on any machine; see :meth:`.Crew.replace`.

        Raises:
            WorkerDiedError: if none has a core for it.
        """
        ray.kill(self._actors[worker])
        self._actors[worker] = self._start[worker]()
        _await_start([self._actors[worker].ready.remote()])

    def close(self) -> None:
        """Ends the actors."""
        for actor in self._actors:
            ray.kill(actor)
        self._actors = []


class _Actor:
    """A worker; ``setup`` is what makes its function, of the process that began it."""

    def __init__(
        self, setup: tuple[Callable[..., Any], dict[str, str], str], *arguments: Any
    ) -> None:
        make, versions, folder = setup

        def checked() -> Callable[[Any], Any]:
            _check_machine(versions, folder)
            return make(*arguments)

        self._function = Function(checked)

    def ready(self) -> None:
        """Returns when the function has been made."""

    def call(self, item: Any) -> Any:
        """Returns the function's result."""
        return self._function(item)


_REMOTE_ACTOR: Any = ray.remote(num_cpus=1)(_Actor)


def get(reference: Any) -> Any:
    """Returns what a reference stands for; raises what its task has raised.

    Raises:
        RayError: if the task was lost.
    """
    try:
        return ray.get(reference)
    except RayTaskError as error:
        raise error.cause from error


def _await_start(ready: list[Any]) -> None:
    started, _ = ray.wait(ready, num_returns=len(ready), timeout=PATIENCE)
    if len(started) < len(ready):
        raise WorkerDiedError(
            f"The Ray cluster has started {len(started)} of {len(ready)} workers in "
            f"{PATIENCE:g} s; its other cores may be taken."
        )


def _died(error: RayError) -> WorkerDiedError:
    """Returns the error of a worker that died, in one line."""
    return WorkerDiedError(f"A worker died: {str(error).splitlines()[-1].strip()}")


def _versions() -> dict[str, str]:
    return {name: version(name) for name in _PACKAGES}


def _check_machine(versions: dict[str, str], folder: str) -> None:
    """Makes the folder the present one; raises InputError unless results are alike."""
    name = platform.node()
    for package, found in _versions().items():
        if found != versions[package]:
            raise InputError(
                f"The machine {name} has {package} {found}, not {versions[package]}; "
                "results are the same with the same versions only."
            )
    try:
        os.chdir(folder)
    except OSError:
        raise InputError(
            f"The machine {name} has no folder {folder!r}; all machines need the same "
            "files at the same places."
        ) from None
