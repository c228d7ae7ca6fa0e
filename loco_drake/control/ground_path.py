"""The path of a base on the ground, and how a velocity command changes it.

A pose on the ground is (x, y, yaw). A velocity is (forward, sideways, yaw rate) in the
heading frame H of the base, which has the base's heading and z up.
"""

import numpy as np
from scipy.ndimage import convolve1d

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import rotate_plane, yaw_of
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import ORIENTATION, POSITION

# The base swings within a stride; its mean over about two strides is its pace.
_PACE_WINDOW = np.hanning(53)[1:-1]  # 1 s
# A critically damped filter has covered 90 % of a step after this many time constants.
_NINETY_PERCENT = 3.8897


def ground_pose(q: Array) -> Array:
    """Returns x, y in m and the continuous yaw in rad of the base, shape (N, 3)."""
    yaw = np.unwrap(yaw_of(q[ORIENTATION]))
    return np.column_stack((q[POSITION][:, :2], yaw))


def path_velocity(pose: Array) -> Array:
    """Returns the velocity between consecutive poses, m/s and rad/s, (N - 1, 3)."""
    turn = np.diff(pose[:, 2])
    step_H = rotate_plane(np.diff(pose[:, :2], axis=0), -(pose[:-1, 2] + turn / 2))
    return np.column_stack((step_H, turn)) / PLAN_DT


def integrate(start: Array, velocity: Array) -> Array:
    """Returns the poses after ``start`` (3,) at these velocities (N, 3).

    It is the inverse of :func:`path_velocity`.
    """
    turn = velocity[:, 2] * PLAN_DT
    yaw = start[2] + np.cumsum(turn)
    step_W = rotate_plane(velocity[:, :2] * PLAN_DT, yaw - turn / 2)
    return np.column_stack((start[:2] + np.cumsum(step_W, axis=0), yaw))


def pace(velocity: Array) -> Array:
    """Returns the mean velocity around each of N samples, from N - 1 steps (N, 3)."""
    if not len(velocity):
        return np.zeros((1, 3))
    # Each sample gets half of the step before it and half of the one after it.
    between = np.pad(velocity, ((1, 1), (0, 0)))
    weight = np.pad(np.ones((len(velocity), 1)), ((1, 1), (0, 0)))
    total, count = (
        convolve1d(a[:-1] + a[1:], _PACE_WINDOW, axis=0, mode="constant")
        for a in (between, weight)
    )
    return total / count


def filtered(
    command: Array,
    speed: Array,
    rate: Array,
    response: float,
    count: int,
    steepest: Array | None = None,
) -> tuple[Array, Array]:
    """Returns how a critically damped filter follows a command from now on.

    Args:
        command: the constant input of the filter, shape (3,).
        speed: output of the filter now, shape (3,).
        rate: its time derivative, shape (3,).
        response: time in which 90 % of a step is covered, s.
        count: number of samples.
        steepest: highest rate of each output, which large steps take longer to keep,
            shape (3,); by default there is none.

    Returns:
        Output and its time derivative after 1 to ``count`` times PLAN_DT, both of shape
        (count, 3).
    """
    output, slope = _critically_damped(command, speed, rate, response, count)
    if steepest is not None:
        for axis in np.flatnonzero((np.abs(slope) > steepest).any(axis=0)):
            output[:, axis], slope[:, axis] = _limited(
                command[axis], speed[axis], rate[axis], response, count, steepest[axis]
            )
    return output, slope


def _critically_damped(
    command: Array, speed: Array, rate: Array, response: float, count: int
) -> tuple[Array, Array]:
    """Returns :func:`filtered` without a limit; inputs are of any one shape (D,)."""
    omega = _NINETY_PERCENT / response
    t = PLAN_DT * np.arange(1, count + 1)[:, None]
    error = speed - command
    slope = rate + omega * error
    decay = np.exp(-omega * t)
    output = command + (error + slope * t) * decay
    return output, (slope - omega * (error + slope * t)) * decay


def _limited(
    command: float,
    speed: float,
    rate: float,
    response: float,
    count: int,
    steepest: float,
) -> tuple[Array, Array]:
    """Returns output and rate, (count,), of a filter whose rate is limited.

    Where the rate would be higher than ``steepest``, it is that one.
    """
    omega = _NINETY_PERCENT / response
    decay = np.exp(-omega * PLAN_DT)
    output, slope = np.empty((2, count))
    for k in range(count):
        error = speed - command
        lead = error + (rate + omega * error) * PLAN_DT
        after = (rate + omega * error - omega * lead) * decay
        if abs(after) > steepest:
            after = float(np.copysign(steepest, after))
            speed += PLAN_DT * (rate + after) / 2
        else:
            speed = command + lead * decay
        rate = after
        output[k], slope[k] = speed, rate
    return output, slope
