"""Types of arrays, of any shape."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Integers = NDArray[np.int64]


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Returns the array itself, which cannot be written from now on."""
    array.setflags(write=False)
    return array
