"""Removes the treadmill: the path that the animal would have on the ground.

Hooves in stance stand on the belt, so the trunk moves over it with their negated
velocity relative to the trunk. Only positions relative to the trunk are used, since the
trunk's own path in a file may be in the treadmill's frame or an estimate of the world.
"""

import numpy as np
from scipy.interpolate import make_smoothing_spline
from scipy.ndimage import binary_erosion

from loco_drake.common.errors import InputError
from loco_drake.datasets.recording import Array

# Candidates for stance are markers this near to their lowest heights, m.
LOW = 0.02
LOW_PERCENTILE = 5.0
# They are in stance if they are not faster than this over the belt, m/s. In a trot the
# trunk's speed varies by .4 m/s, so the first pass, which uses its mean, is tolerant.
NEAR = (0.5, 0.3, 0.2)
# Time after touchdown and before lift-off in which a hoof slides or rolls, s.
EDGE_SECONDS = 0.02
# Of the trunk's velocity, Hz: the fifth harmonic of a trot's steps is noise.
CUTOFF = 8.0


def trunk_path(trunk: Array, hooves: Array, fps: float) -> Array:
    """Returns the horizontal path of the trunk over the belt, from the origin.

    Args:
        trunk: position of a marker on the trunk in any frame in m, shape (T, 3).
        hooves: positions of the hooves in the same frame, shape (T, 4, 3).
        fps: frames per second.

    Returns:
        Positions in m, shape (T, 2).

    Raises:
        InputError: if no hoof ever stands.
    """
    relative = (hooves - trunk[:, None])[..., :2]
    velocity = _trunk_velocity(relative, hooves[..., 2], fps)
    steps = (velocity[1:] + velocity[:-1]) / (2 * fps)
    path: Array = np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))
    return path


def _trunk_velocity(relative: Array, heights: Array, fps: float) -> Array:
    """Returns the trunk's horizontal velocity over the belt in m/s, shape (T, 2).

    It is the negated mean relative velocity of the hooves in stance, interpolated
    through flight phases, in which nothing propels the trunk, and smoothed.
    """
    time = np.arange(len(relative)) / fps
    hoof_velocity = np.gradient(relative, 1 / fps, axis=0)
    height = heights - np.percentile(heights, LOW_PERCENTILE, axis=0)
    low = height < LOW
    edge = round(EDGE_SECONDS * fps)
    middle = np.ones((2 * edge + 1, 1), dtype=bool)
    mean = -np.median(hoof_velocity[height < LOW / 2], axis=0)
    velocity: Array = np.broadcast_to(mean, (len(relative), 2))
    for near in NEAR:
        over_belt = np.linalg.norm(hoof_velocity + velocity[:, None], axis=-1)
        stance = binary_erosion(low & (over_belt < near), middle, border_value=1)
        count = stance.sum(axis=1)
        seen = count > 0
        if not seen.any():
            raise InputError(
                "No hoof ever stands on the treadmill, so the horse's speed is not "
                "known (are the hooves' columns in order?)."
            )
        total = (hoof_velocity * stance[..., None]).sum(axis=1)
        measured = -total[seen] / count[seen, None]
        between = [np.interp(time, time[seen], component) for component in measured.T]
        # min sum (x - y)^2 + s integral x''^2 halves the amplitude of CUTOFF.
        stiffness = fps / (2 * np.pi * CUTOFF) ** 4
        filled = np.stack(between, axis=-1)
        velocity = make_smoothing_spline(time, filled, lam=stiffness)(time)
    return velocity
