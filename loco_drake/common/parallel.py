"""The same work on many items, in worker processes."""

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from loco_drake.common.determinism import use_one_thread
from loco_drake.common.errors import check_at_least

Item = TypeVar("Item")
Result = TypeVar("Result")

# What each worker process made for itself.
_function: Callable[[Any], Any]


def map_in_workers(
    make: Callable[[], Callable[[Item], Result]],
    items: Iterable[Item],
    workers: int,
) -> Iterator[Result]:
    """Yields the result for each item, in the order of the items.

    Each worker makes its function once and then works on one item after the other;
    with one worker that is this process. Closing the iterator, or an exception such as
    Ctrl-C, waits for the items under way and drops the others.

    Args:
        make: returns the function; it, the items and the results must be picklable.
        items: what to work on.
        workers: processes, at least 1.

    Raises:
        InputError: if ``workers`` is below 1.
        ChildProcessError: if a worker process is killed.
    """
    check_at_least("workers", workers, 1)
    return _map_here(make, items) if workers == 1 else _map(make, items, workers)


def _map_here(
    make: Callable[[], Callable[[Item], Result]], items: Iterable[Item]
) -> Iterator[Result]:
    function = make()
    for item in items:
        yield function(item)


def _map(
    make: Callable[[], Callable[[Item], Result]], items: Iterable[Item], workers: int
) -> Iterator[Result]:
    executor = ProcessPoolExecutor(
        max_workers=workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start,
        initargs=(make,),
    )
    try:
        yield from executor.map(_call, items)
    except BrokenProcessPool:
        raise ChildProcessError("A worker process died.") from None
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _start(make: Callable[[], Callable[[Any], Any]]) -> None:
    # Ctrl-C reaches the whole group of processes; the main one decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    use_one_thread()
    global _function
    _function = make()


def _call(item: Any) -> Any:
    return _function(item)
