"""The torques that carry the robot along its plan, before any feedback."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.rotations import quat_conjugate, quat_rotate
from loco_drake.models.kinematics import toe_jacobians
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import FPS

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s^2
_MAX_LOAD = 2.5  # robot weights


def feed_forward_torques(
    robot: Robot, q: Array, v: Array, contacts: NDArray[np.bool_]
) -> Array:
    """Returns joint torques (N, 12) in Nm that a plan takes, roughly.

    The feet in contact share equally the vertical force m (g + a) that the planned
    acceleration a of the base asks for, and the joints balance it: tau = -J^T f. To
    this comes what accelerates each joint, with its inertia in the usual stance; the
    legs' weight and their coupling are left out. A feed-forward of this kind is what
    lets trackers learn from few samples (Fuchioka et al. 2023, OPT-Mimic): it spares
    the policy from having to learn first that robots have mass.

    Args:
        robot: the robot.
        q: positions as in :class:`Plan`, shape (N, 19).
        v: velocities as in :class:`Plan`, shape (N, 18).
        contacts: which feet are planned to be on the ground, shape (N, 4).
    """
    acceleration = np.gradient(v, axis=0) * FPS if len(v) > 1 else np.zeros_like(v)
    load = np.clip(1 + acceleration[:, 5] / GRAVITY, 0.0, _MAX_LOAD)
    share = contacts / np.maximum(contacts.sum(axis=1, keepdims=True), 1)
    force = robot.mass * GRAVITY * load[:, None] * share  # (N, 4)
    up_B = quat_rotate(quat_conjugate(q[:, :4]), np.array([0.0, 0.0, 1.0]))
    # (N, 4, 3 rows x y z, 3 joints) against (N, 3)
    lift = np.einsum("nlij,ni->nlj", toe_jacobians(robot, q[:, 7:]), up_B)
    support = (-force[..., None] * lift).reshape(len(q), -1)
    return support + robot.joint_inertia * acceleration[:, 6:]
