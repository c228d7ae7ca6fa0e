"""Where things are in a robot's state [q, v], and its base's quaternion at length one.

The order is that of the plant: q = [q_WB as w x y z, p_WB, joints], of size 7 + J, and
v = [w_WB_W, v_WB_W, joint velocities], of size 6 + J. ``q[JOINTS]`` and the like take
arrays of any leading shape, which Drake's namedview does not.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of q.
ORIENTATION = np.s_[..., :4]
POSITION = np.s_[..., 4:7]
JOINTS = np.s_[..., 7:]
HEIGHT = 6
# Of v.
ANGULAR_VELOCITY = np.s_[..., :3]
VELOCITY = np.s_[..., 3:6]
JOINT_VELOCITIES = np.s_[..., 6:]

_ROUNDING = (
    1e-14  # what dividing a quaternion by its length leaves of the square's error
)


def split(state: Array) -> tuple[Array, Array]:
    """Returns views of q, shape (..., 7 + J), and v, shape (..., 6 + J)."""
    positions = (state.shape[-1] + 1) // 2
    return state[..., :positions], state[..., positions:]


def unit_base(state: Array) -> Array:
    """Returns states, or positions, whose quaternion of the base has length one.

    Drake's discrete plants integrate the quaternion and never normalize it: its length
    grows by a few per cent in ten seconds of a trot. The plant itself does not mind.
    What is one up to rounding stays as it is, so that doing it twice is doing it once.

    Args:
        state: [q, v] or q, shape (..., n).
    """
    w, x, y, z = (state[..., i] for i in range(4))
    square = w * w + x * x + y * y + z * z
    off = np.abs(square - 1) > _ROUNDING
    if not off.any():
        return state
    result = state.copy()
    result[ORIENTATION] *= np.where(off, 1 / np.sqrt(square), 1.0)[..., None]
    return result
