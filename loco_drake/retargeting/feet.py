"""Toe trajectories that a robot can have: still in stance, never below the ground.

For each leg, the trajectory nearest to the formula's whose third differences are small
(:mod:`loco_drake.retargeting.smoothing`), such that the toe does not move while it is
in contact. The place where a foot stands and the way in which it swings there are so
found together, and neither touchdown nor lift-off has a jump:

    min  sum_t |p_t - target_t|^2 + w |D p|^2
    s.t. p_t = p_(t+1) within each contact;  p_t,z = foot_radius in contact;
         p_t,z >= foot_radius + clearance_t in swing.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, eye_array
from scipy.sparse.linalg import spsolve

from loco_drake.common.runs import intervals
from loco_drake.retargeting.smoothing import difference_matrix, penalty

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Toes swing at least this high over the ground, in m, at mid-swing; and at least as
# high as a swing that takes off and lands with this vertical acceleration, in m/s^2.
CLEARANCE = 0.015
LIFT_ACCELERATION = 20.0

_MAX_ROUNDS = 20


def plant_feet(
    p_WF: Array, contacts: Bools, foot_radius: float, cutoff: float, fps: float
) -> Array:
    """Returns toe trajectories that stand still in contact and swing above the ground.

    Args:
        p_WF: the formula's targets in m, shape (T, 4, 3).
        contacts: whether each toe is on the ground, shape (T, 4).
        foot_radius: of the toe sphere in m.
        cutoff: of the smoothing, Hz.
        fps: frames per second.

    Returns:
        Toe positions in m, shape (T, 4, 3).
    """
    weight = penalty(cutoff, fps)
    D = difference_matrix(len(p_WF))
    smoothness = weight * (D.T @ D) + eye_array(len(p_WF))
    planted = np.empty_like(p_WF)
    for leg in range(4):
        target, contact = p_WF[:, leg], contacts[:, leg]
        planted[:, leg, :2] = _fit_ground_plane(target[:, :2], contact, smoothness)
        floor = foot_radius + swing_clearance(contact, fps)
        planted[:, leg, 2] = _fit_height(target[:, 2], contact, floor, smoothness)
    return planted


def swing_clearance(contact: Bools, fps: float) -> Array:
    """Returns how far over the ground a toe must swing, in m, shape (T,).

    Zero in contact and at the ends of each swing, :data:`CLEARANCE` at mid-swing if the
    swing is long enough; the clip's ends count as mid-swing.
    """
    clearance = np.zeros(len(contact))
    for start, end in intervals(~contact):
        frames = np.arange(start, end)
        since = np.full(end - start, np.inf) if start == 0 else frames - start + 1.0
        until = np.full(end - start, np.inf) if end == len(contact) else end - frames
        seconds = np.minimum(since, until) / fps
        parabola = LIFT_ACCELERATION * seconds**2 / 2
        clearance[start:end] = np.minimum(parabola, CLEARANCE)
    return clearance


def _fit_ground_plane(target: Array, contact: Bools, smoothness: csc_matrix) -> Array:
    """Returns x, y (T, 2) nearest to ``target`` that are constant in each contact."""
    columns = np.cumsum(_starts_new_value(contact)) - 1
    frames = len(target)
    M = csr_matrix((np.ones(frames), (np.arange(frames), columns)))
    values = spsolve(csc_matrix(M.T @ smoothness @ M), M.T @ target)
    fitted: Array = M @ values.reshape(-1, 2)
    return fitted


def _starts_new_value(contact: Bools) -> Bools:
    """Returns where a value differs from the frame before: not within a contact."""
    new = np.ones(len(contact), dtype=bool)
    new[1:] = ~(contact[1:] & contact[:-1])
    return new


def _fit_height(
    target: Array, contact: Bools, floor: Array, smoothness: csc_matrix
) -> Array:
    """Returns z (T,) nearest to ``target``, at ``floor`` in contact, never below it.

    An active-set method: frames that would sink are held at the floor, until none does.
    """
    held = contact.copy()
    height = floor.copy()
    for _ in range(_MAX_ROUNDS):
        free = ~held
        if not free.any():
            break
        coupling = smoothness.tocsr()[free]
        right = target[free] - coupling[:, held] @ floor[held]
        height = floor.copy()
        height[free] = spsolve(csc_matrix(coupling[:, free]), right)
        sunk = height < floor - 1e-9
        if not sunk.any():
            break
        held |= sunk
    return np.maximum(height, floor)
