"""Runs of True in boolean arrays."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray


def intervals(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yields the first and end frame (exclusive) of each run of True in ``flags``."""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    for start, end in edges.reshape(-1, 2):
        yield int(start), int(end)
