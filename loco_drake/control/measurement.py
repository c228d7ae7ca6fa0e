"""What a robot measures of its state, which is not quite its state."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_exp, quat_multiply, quat_rotate
from loco_drake.control.domain import SensorErrors

Array = NDArray[np.float64]

# Name and size of each part of an error, in order.
ERROR_LAYOUT = (
    ("orientation", 3),  # rotation vector in B, rad
    ("position", 3),  # of the base in the world, m
    ("joint_positions", 12),  # rad
    ("angular_velocity", 3),  # of the base, in B, rad/s
    ("velocity", 3),  # of the base, in B, m/s
    ("joint_velocities", 12),  # rad/s
)
ERROR_SIZE = sum(size for _, size in ERROR_LAYOUT)


def error_vector(**sizes: float) -> Array:
    """Returns an error (ERROR_SIZE,) whose named parts have these values, others 0."""
    unknown = sizes.keys() - dict(ERROR_LAYOUT).keys()
    if unknown:
        raise TypeError(f"errors have no part {', '.join(sorted(unknown))}")
    return np.concatenate(
        [np.full(size, sizes.get(name, 0.0)) for name, size in ERROR_LAYOUT]
    )


def draw_error(errors: SensorErrors, sample: int) -> Array:
    """Returns the error of one sample of the clock, (ERROR_SIZE,): always the same."""
    random = np.random.default_rng((errors.seed, sample))
    return errors.bias + errors.white * random.standard_normal(ERROR_SIZE)


def measure(state: Array, error: Array) -> Array:
    """Returns measured states [q, v], shape (..., 37).

    What the policy sees of robot and plan is computed from these, so that an error of
    an encoder shows in all that depends on it.

    Args:
        state: the plant's [q, v], shape (..., 37).
        error: see :data:`ERROR_LAYOUT`, shape (..., ERROR_SIZE).
    """
    q_WB = state[..., :4]
    measured = state.copy()
    measured[..., :4] = quat_multiply(q_WB, quat_exp(error[..., :3]))
    measured[..., 4:19] += error[..., 3:18]
    measured[..., 19:22] += quat_rotate(q_WB, error[..., 18:21])
    measured[..., 22:25] += quat_rotate(q_WB, error[..., 21:24])
    measured[..., 25:] += error[..., 24:]
    return measured
