"""What the engines have in common."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from loco_drake.common.determinism import use_one_thread
from loco_drake.common.drake_log import quiet_drake
from loco_drake.common.errors import check_at_least

Item = TypeVar("Item")
Result = TypeVar("Result")

# How often a task, or a start, is tried whose worker dies.
TRIES = 3


class WorkerDiedError(ChildProcessError):
    """A worker died: it was killed, or its machine is gone."""


@dataclass(frozen=True)
class Executor(ABC):
    """Runs tasks in workers. The results do not depend on where, nor on how many.

    Raises:
        InputError: if ``workers``, the number for :meth:`map`, is below 1.
    """

    workers: int = 1

    def __post_init__(self) -> None:
        check_at_least("workers", self.workers, 1)

    @abstractmethod
    def map(
        self, make: Callable[[], Callable[[Item], Result]], items: Iterable[Item]
    ) -> Iterator[Result]:
        """Yields the result for each item, in order.

        Each worker creates its function once and processes one item at a time. If a
        worker dies, another one does its item again. Closing the iterator, or an
        exception such as Ctrl-C, waits for items in progress and drops the others.

        Args:
            make: returns the function; it, the items and the results must be picklable.
            items: the items.

        Raises:
            WorkerDiedError: if the workers die TRIES times at one item.
        """

    @abstractmethod
    def crew(
        self, make: Callable[[Any], Callable[[Any], Any]], arguments: Sequence[Any]
    ) -> "Crew":
        """Returns workers that keep a state, each with what ``make`` gives for its own.

        There is one for each of the ``arguments``, whatever :attr:`workers` is.
        """


class Crew(ABC):
    """Workers that keep a state; each is sent one message at a time, and answers it."""

    @abstractmethod
    def send(self, worker: int, message: Any) -> None:
        """Sends a message to a worker; never waits for its answer."""

    @abstractmethod
    def receive(self, worker: int) -> Any:
        """Returns the answer of a worker to its last message, or raises what it raised.

        Raises:
            WorkerDiedError: if it has died. It is to be replaced then.
        """

    @abstractmethod
    def replace(self, worker: int) -> None:
        """Puts a new worker, without the other's state, in the place of one."""

    @abstractmethod
    def close(self) -> None:
        """Ends the workers."""


class Function:
    """The function of a worker. What making it raises, each call raises."""

    def __init__(self, make: Callable[[], Callable[[Any], Any]]) -> None:
        use_one_thread()
        quiet_drake()
        self._error: Exception | None = None
        try:
            self._function = make()
        except Exception as error:
            self._error = error

    def __call__(self, item: Any) -> Any:
        """Returns the result for an item."""
        if self._error is not None:
            raise self._error
        return self._function(item)


def gave_up() -> WorkerDiedError:
    """Returns the error when the workers have died TRIES times at one item."""
    return WorkerDiedError(f"A worker process died {TRIES} times at the same task.")
