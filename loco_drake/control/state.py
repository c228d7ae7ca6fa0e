"""The state [q, v] of a robot: its parts, its unit quaternion, and when it is lost.

The order is the plant's: q = [q_WB as w x y z, p_WB, joints], of size 7 + J, and v =
[w_WB_W, v_WB_W, joint velocities], of size 6 + J. Unlike Drake's namedview,
``q[JOINTS]`` and the other indices accept arrays of any leading shape.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.errors import check_bounds
from loco_drake.common.rotations import quat_to_matrix
from loco_drake.models.simulated import SimulatedRobot

# Of q.
ORIENTATION = np.s_[..., :4]
POSITION = np.s_[..., 4:7]
JOINTS = np.s_[..., 7:]
HEIGHT = 6
# Of v.
ANGULAR_VELOCITY = np.s_[..., :3]
VELOCITY = np.s_[..., 3:6]
JOINT_VELOCITIES = np.s_[..., 6:]

# What dividing a quaternion by its length leaves of the square's error.
_ROUNDING = 1e-14
# A robot that tilts further does not recover.
MAX_TILT = np.deg2rad(60.0)
_CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


def split(state: Array) -> tuple[Array, Array]:
    """Returns views of q, shape (..., 7 + J), and v, shape (..., 6 + J)."""
    positions = (state.shape[-1] + 1) // 2
    return state[..., :positions], state[..., positions:]


def unit_base(state: Array) -> Array:
    """Returns states [q, v] or positions q, (..., n), with unit base quaternions.

    Drake's discrete plants integrate the quaternion and never normalize it. Its norm
    grows by a few per cent in ten seconds of a trot. A quaternion that has length one
    up to rounding is returned unchanged, so the function is idempotent.
    """
    w, x, y, z = (state[..., i] for i in range(4))
    square = w * w + x * x + y * y + z * z
    off = np.abs(square - 1) > _ROUNDING
    if not off.any():
        return state
    result = state.copy()
    result[ORIENTATION] *= np.where(off, 1 / np.sqrt(square), 1.0)[..., None]
    return result


def has_fallen(robot: SimulatedRobot, q: Array) -> Bools:
    """Returns whether the trunk touches the ground or tilts by more than 60 degrees.

    The result has one bool, shape (...), for each row of positions q, (..., 7 + J).
    """
    # The world's z axis in the trunk's frame.
    z_B = quat_to_matrix(q[ORIENTATION])[..., 2, :]
    lowest = q[..., HEIGHT] + (z_B @ (_CORNERS * robot.trunk_size).T).min(axis=-1)
    return (lowest <= 0) | (z_B[..., 2] < np.cos(MAX_TILT))


@dataclass(kw_only=True)
class TerminationConfig:
    """Distance from the plan at which an episode ends.

    The joints alone cannot detect a robot that stands still while its plan moves on, so
    errors of the base terminate episodes as well (Bogdanovic et al. 2022 and others).
    """

    # Distance between the base and the plan's base, m.
    position: float = 0.35
    # Angle between the base and the plan's base, rad.
    rotation: float = 0.8

    def check(self) -> None:
        """Raises InputError unless both are above 0."""
        for name, value in vars(self).items():
            # Infinity never terminates.
            if value != np.inf:
                check_bounds(f"The termination's {name}", value, 0, above=True)

    def exceeded(self, state: Array, plan_state: Array) -> Bools:
        """Returns whether each robot is too far from its plan to come back, (...).

        Both states are [q, v], shape (..., 13 + 2 J).
        """
        gap = np.linalg.norm(state[POSITION] - plan_state[POSITION], axis=-1)
        # A turn by an angle a takes a unit quaternion to one whose product with it is
        # cos(a / 2), up to its sign.
        product = np.einsum(
            "...i,...i->...", state[ORIENTATION], plan_state[ORIENTATION]
        )
        turn = 2 * np.arccos(np.minimum(np.abs(product), 1.0))
        return (gap > self.position) | (turn > self.rotation)
