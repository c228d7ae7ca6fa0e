"""The measured state: the true state with sensor errors."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_exp, quat_multiply, quat_rotate
from loco_drake.control.domain import ERROR_LAYOUT, ERROR_SIZE, SensorErrors
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    JOINT_VELOCITIES,
    ORIENTATION,
    VELOCITY,
    split,
)

Array = NDArray[np.float64]


def error_vector(**sizes: float) -> Array:
    """Returns an error (ERROR_SIZE,) with the named parts set and all others 0."""
    unknown = sizes.keys() - dict(ERROR_LAYOUT).keys()
    if unknown:
        raise TypeError(f"errors have no part {', '.join(sorted(unknown))}")
    return np.concatenate(
        [np.full(size, sizes.get(name, 0.0)) for name, size in ERROR_LAYOUT]
    )


def draw_error(errors: SensorErrors, sample: int) -> Array:
    """Returns the error (ERROR_SIZE,) of one sample of the clock, deterministically."""
    random = np.random.default_rng((errors.seed, sample))
    return errors.bias + errors.white * random.standard_normal(ERROR_SIZE)


def measure(state: Array, error: Array) -> Array:
    """Returns measured states [q, v], shape (..., 37).

    The observation is computed from the measured state, so an encoder error affects
    every part that depends on it.

    Args:
        state: the plant's [q, v], shape (..., 37).
        error: see :data:`ERROR_LAYOUT`, shape (..., ERROR_SIZE).
    """
    measured = state.copy()
    q, v = split(measured)
    q_WB = state[ORIENTATION]
    q[ORIENTATION] = quat_multiply(q_WB, quat_exp(error[..., :3]))
    q[..., 4:] += error[..., 3:18]
    v[ANGULAR_VELOCITY] += quat_rotate(q_WB, error[..., 18:21])
    v[VELOCITY] += quat_rotate(q_WB, error[..., 21:24])
    v[JOINT_VELOCITIES] += error[..., 24:]
    return measured
