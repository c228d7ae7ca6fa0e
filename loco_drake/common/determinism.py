"""The same numbers each time: one thread, and dice named by what they are for.

The networks are small, and a second thread gains nothing: it only spins where another
program has its core, and takes sums in another order.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray


def use_one_thread() -> None:
    """Makes this process, and those that it starts, compute on one thread for good.

    It is called where a process is the library's own: commands and workers.
    """
    from threadpoolctl import threadpool_limits

    for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM"):  # loaded later
        os.environ[f"{library}_NUM_THREADS"] = "1"
    threadpool_limits(1)  # loaded already
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


@contextmanager
def single_thread() -> Iterator[None]:
    """Runs torch on one thread, in a process that may be a user's own."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def uniforms(seed: int, index: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Returns numbers in [0, 1) that depend on nothing but the arguments."""
    return np.random.Generator(np.random.Philox(key=[seed, index])).random(shape)
