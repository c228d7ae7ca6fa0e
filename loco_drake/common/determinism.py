"""Reproducible results: single-threaded computation and keyed random numbers.

The networks are small. A second thread gains nothing, waits for busy cores and changes
the order of sums.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray


def use_one_thread() -> None:
    """Makes this process and its children use one thread permanently.

    Only for processes that belong to the library: commands and workers.
    """
    from threadpoolctl import threadpool_limits

    for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM"):  # loaded later
        os.environ[f"{library}_NUM_THREADS"] = "1"
    threadpool_limits(1)  # loaded already
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


@contextmanager
def single_thread() -> Iterator[None]:
    """Runs torch on one thread within the block, for processes of the user."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def uniforms(seed: int, index: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Returns random numbers in [0, 1) that depend only on the arguments."""
    return np.random.Generator(np.random.Philox(key=[seed, index])).random(shape)
