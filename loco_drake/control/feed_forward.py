"""The joint torques of a plan, by inverse dynamics."""

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.gravity import GRAVITY
from loco_drake.common.rotations import quat_to_matrix
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.control.state import JOINTS, ORIENTATION, VELOCITY, unit_base
from loco_drake.models.dynamics import inverse_dynamics
from loco_drake.models.simulated import SimulatedRobot

# What it is called in the files of policies, which were trained on top of it.
FEED_FORWARD = "inverse dynamics"
MAX_LOAD = 2.5  # vertical force of a foot, robot weights
FRICTION = 0.6  # that the feed-forward relies on
# Weight of moments against forces in the balance of the base, 1/m.
MOMENT_WEIGHT = 5.0
# Preference for equal vertical forces over an exact balance, which the motion of an
# animal on a rigid trunk may not allow.
DAMPING = 0.1


def feed_forward_torques(robot: SimulatedRobot, plan: Plan) -> Array:
    """Returns mean joint torques in the periods that end at the samples, (N, J), N m.

    They are the inverse dynamics of the whole robot between two samples, in contact
    with the ground at the feet that stand at the second:

        tau = [M vdot + C v - tau_g]_J - sum J_J^T f

    with :func:`stance_forces` f. Such a feed-forward reduces the samples that a tracker
    needs (Fuchioka et al. 2023, OPT-Mimic).
    """
    q, v, vdot = mid_samples(plan)
    needed = inverse_dynamics(robot, q, v, vdot)
    R_WB = quat_to_matrix(q[ORIENTATION])
    # Positions and Jacobians of the contacts relative to the base, in the world.
    p_BF_W = np.einsum("nij,nlj->nli", R_WB, robot.contact_points(q[JOINTS]))
    J = np.einsum("nij,nljk->nlik", R_WB, robot.contact_jacobians(q[JOINTS]))
    load = robot.mass * (GRAVITY + vdot[VELOCITY][:, 2])
    f = stance_forces(needed[:, :6], p_BF_W, plan.contacts, load)
    f = _admissible(f, MAX_LOAD * GRAVITY * robot.mass)
    support = np.zeros_like(needed[:, 6:])
    of_contacts = np.einsum("nlik,nli->nlk", J, f)
    for k, joints in enumerate(robot.contact_joints):
        support[:, joints] += of_contacts[:, k]
    return needed[:, 6:] - support


def mid_samples(plan: Plan) -> tuple[Array, Array, Array]:
    """Returns q, v and vdot halfway between each sample and the one before it.

    The first sample, which has none before it, is itself.
    """
    before = np.maximum(np.arange(len(plan)) - 1, 0)
    q0, v0 = plan.q[before], plan.v[before]
    # A quaternion and its negative are the same orientation.
    same = np.sum(q0[ORIENTATION] * plan.q[ORIENTATION], axis=-1, keepdims=True) < 0
    q0 = np.where(same & (np.arange(q0.shape[-1]) < 4), -q0, q0)
    vdot = (plan.v - v0) / PLAN_DT
    vdot[0] = plan.vdot[0]
    return unit_base((q0 + plan.q) / 2), (v0 + plan.v) / 2, vdot


def stance_forces(needed: Array, p_BF_W: Array, contacts: Bools, load: Array) -> Array:
    """Returns forces in the world on the feet that stand, N, shape (N, 4, 3).

    Their sum and moment about the base come near ``needed`` (N, 6), moment then force.
    They minimize |A f - needed|^2 + .1 |f - f_0|^2, moments weighted by 5 / m, where
    f_0 are equal vertical forces that sum to ``load`` (N,): damped least squares.
    ``p_BF_W`` (N, 4, 3) are the toes from the base's origin, and ``contacts``
    (N, 4) says which feet stand.
    """
    n = len(needed)
    stands = contacts.astype(np.float64)
    f0 = np.zeros((n, 4, 3))
    share = stands / np.maximum(stands.sum(axis=1, keepdims=True), 1)
    f0[..., 2] = np.maximum(load, 0)[:, None] * share
    # Rows: moment, force; columns: the feet's x, y, z.
    A = np.zeros((n, 6, 4, 3))
    x, y, z = np.moveaxis(p_BF_W, -1, 0)
    A[:, 0, :, 1], A[:, 0, :, 2] = -z, y
    A[:, 1, :, 0], A[:, 1, :, 2] = z, -x
    A[:, 2, :, 0], A[:, 2, :, 1] = -y, x
    A[:, :3] *= MOMENT_WEIGHT
    for i in range(3):
        A[:, 3 + i, :, i] = 1.0
    A *= stands[:, None, :, None]
    rows = A.reshape(n, 6, 12)
    weights = np.repeat([MOMENT_WEIGHT, 1.0], 3)
    lack = weights * needed - np.einsum("nij,nj->ni", rows, f0.reshape(n, 12))
    normal = rows @ np.swapaxes(rows, 1, 2) + DAMPING * np.eye(6)
    step = np.linalg.solve(normal, lack[..., None])
    return f0 + (np.swapaxes(rows, 1, 2) @ step).reshape(n, 4, 3)


def _admissible(f: Array, most: float) -> Array:
    """Returns the forces pushed into the friction cone, and not above ``most``."""
    up = np.clip(f[..., 2], 0.0, most)
    along = np.hypot(f[..., 0], f[..., 1])
    share = np.minimum(1.0, FRICTION * up / np.maximum(along, 1e-9))
    return np.concatenate((f[..., :2] * share[..., None], up[..., None]), axis=-1)
