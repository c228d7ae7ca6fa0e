"""Small changes of a state [q, v], with a rotation vector for the quaternion's change.

A change has 12 + 2 J numbers: the base's rotation (rad, in the world) and translation
(m), the joints (rad), and the change of v, whose order is the plant's.
"""

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_error, quat_exp, quat_multiply
from loco_drake.control.state import ORIENTATION


def changed(state: Array, change: Array) -> Array:
    """Returns states (..., 13 + 2 J) changed by ``change`` (..., 12 + 2 J)."""
    turned = quat_multiply(quat_exp(change[..., :3]), state[ORIENTATION])
    return np.concatenate((turned, state[..., 4:] + change[..., 3:]), axis=-1)


def change_between(start: Array, end: Array) -> Array:
    """Returns the change (..., 12 + 2 J) that makes states ``end`` of ``start``."""
    turn = quat_error(start[ORIENTATION], end[ORIENTATION])
    return np.concatenate((turn, end[..., 4:] - start[..., 4:]), axis=-1)
