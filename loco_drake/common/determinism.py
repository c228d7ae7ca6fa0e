"""The same numbers each time: one thread, and dice named by what they are for."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from numpy.typing import NDArray


@contextmanager
def single_thread() -> Iterator[None]:
    """Runs torch on one thread: sums are then always taken in the same order."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def uniforms(seed: int, index: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Returns numbers in [0, 1) that depend on nothing but the arguments."""
    return np.random.Generator(np.random.Philox(key=[seed, index])).random(shape)
