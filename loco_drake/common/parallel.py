"""Parallel map in worker processes."""

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

# The function of this worker process.
_function: Callable[[Any], Any]


def map_in_workers(
    make: Callable[[], Callable[[Item], Result]],
    items: Iterable[Item],
    workers: int,
) -> Iterator[Result]:
    """Yields the result for each item, in order.

    Each worker creates its function once and processes one item at a time. With one
    worker, that is this process. Closing the iterator, or an exception such as Ctrl-C,
    waits for items in progress and drops the others.

    Args:
        make: returns the function; it, the items and the results must be picklable.
        items: the items.
        workers: number of processes, at least 1.

    Raises:
        InputError: if ``workers`` is below 1.
        ChildProcessError: if a worker process is killed.
    """
    check_at_least("workers", workers, 1)
    return _map(make, items, workers)


def _map(
    make: Callable[[], Callable[[Item], Result]], items: Iterable[Item], workers: int
) -> Iterator[Result]:
    if workers == 1:
        yield from map(make(), items)
        return
    executor = ProcessPoolExecutor(
        max_workers=workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start,
        initargs=(make,),
    )
    try:
        # Ctrl-C reaches the whole process group; only the main process handles it. The
        # workers, which start here, inherit that it is blocked.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            results = executor.map(_call, items)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield from results
    except BrokenProcessPool:
        raise ChildProcessError("A worker process died.") from None
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _start(make: Callable[[], Callable[[Any], Any]]) -> None:
    use_one_thread()
    global _function
    _function = make()


def _call(item: Any) -> Any:
    return _function(item)
