"""One step of grounding as a convex program, see :mod:`.grounding`.

The unknowns are the trunk's steps x, six numbers per frame, and the forces f of the N
feet in contact, three numbers each, ordered by frame. Forces are in robot weights,
moments in robot weights at the standing height.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import (
    bsr_array,
    csc_matrix,
    csr_matrix,
    diags_array,
    eye_array,
    hstack,
    kron,
    vstack,
)

from loco_drake.common.arrays import Array, Bools, Integers
from loco_drake.common.gravity import GRAVITY
from loco_drake.motion.momentum import GRAVITY_W
from loco_drake.retargeting.correction import difference_matrix
from loco_drake.retargeting.least_squares import solve_least_squares

_EDGES = 8  # of the pyramid inside a cone of friction
_NEAR = 0.15  # rad and m; a limit that is further away cannot be reached in a step


@dataclass(frozen=True, kw_only=True)
class GroundingConfig:
    """Sizes that cost as much as each other, per frame, and limits."""

    shift: float = 0.05  # of the trunk, m
    turn: float = 0.2  # of the trunk, rad
    # A shift or turn of this size that oscillates costs as much again by its third
    # differences at this frequency, Hz.
    smoothness: float = 5.0
    joint: float = 0.1  # change of a joint, rad
    force_change: float = 1.0  # of a foot's force from frame to frame
    # Force or moment that the feet do not give.
    missing: float = 0.05
    friction: float = 0.6  # below that of the ground, as a margin for the tracker
    most_force: float = 2.5  # of one foot, upward
    iterations: int = 4


@dataclass(frozen=True, kw_only=True)
class Linearization:
    """A motion of T frames and its derivatives by the trunk's steps, in the world."""

    moved: Array  # trunk's [rotation vector, shift] so far, rad and m, (T, 6)
    com: Array  # m, (T, 3)
    com_matrices: Array  # derivatives, (T, 3, 6)
    angular: Array  # angular momentum halfway between frames, kg m^2/s, (T - 1, 3)
    angular_matrices: Array  # ... by the rate of the steps, (T, 3, 6)
    joints: Array  # rad, (T, J)
    joints_moved: Array  # so far, rad, (T, J)
    joint_matrices: Array  # derivatives, (T, J, 6)
    joint_lower: Array  # rad, (J,)
    joint_upper: Array  # rad, (J,)
    joint_step: Array  # largest change from frame to frame, rad, (J,)
    knees: Array  # heights over the lowest, m, (T, 4)
    knee_matrices: Array  # derivatives, (T, 4, 6)
    soles: Array  # where the forces act, m, (T, 4, 3)
    forces: Array  # of the last program, (T, 4, 3)
    contacts: Bools  # (T, 4)
    mass: float  # kg
    height: float  # standing, m
    fps: float  # frames/s


def solve_step(at: Linearization, config: GroundingConfig) -> tuple[Array, Array]:
    """Returns the trunk's steps, rad and m, (T, 6), and the feet's forces (T, 4, 3)."""
    frames = len(at.com)
    frame, foot = np.nonzero(at.contacts)
    costs = [
        _weighted(*_force_rows(at, frame), config.missing),
        _weighted(*_moment_rows(at, frame, foot), config.missing),
        *_correction_costs(at, len(frame), config),
        _weighted(*_force_changes(at.contacts), config.force_change),
    ]
    A = csc_matrix(vstack([rows for rows, _ in costs]))
    b = np.concatenate([right for _, right in costs])
    limits = [_limits(at, len(frame)), _cones(frames, len(frame), config)]
    G = csc_matrix(vstack([rows for rows, _ in limits]))
    h = np.concatenate([most for _, most in limits])
    solution = solve_least_squares(A, b, G, h)
    forces = np.zeros((frames, 4, 3))
    forces[frame, foot] = solution[6 * frames :].reshape(-1, 3)
    return solution[: 6 * frames].reshape(frames, 6), forces


# Rows are a matrix over [x, f]; a pair (rows, right) is rows [x, f] - right.
_Rows = tuple[csc_matrix, Array]


def _force_rows(at: Linearization, frame: Integers) -> _Rows:
    """Returns (c'' - g) / g - sum f in the frames 1 to T - 2."""
    frames = len(at.com)
    scale = at.fps**2 / GRAVITY
    second = diags_array(
        (1.0, -2.0, 1.0), offsets=(0, 1, 2), shape=(frames - 2, frames)
    )
    now = np.diff(at.com, 2, axis=0) * scale - GRAVITY_W / GRAVITY
    motion = scale * _per_axis(second, 3) @ _blocks(at.com_matrices)
    return hstack((motion, -_per_axis(_inner_sums(frame, frames), 3))), -now.ravel()


def _moment_rows(at: Linearization, frame: Integers, foot: Integers) -> _Rows:
    """Returns L' / (m g h) - sum (p - c) / h x f in the frames 1 to T - 2.

    A step changes L by its rate, and the arms (p - c) of the last forces by its shift
    of c.
    """
    frames = len(at.com)
    scale = at.fps / (at.mass * GRAVITY * at.height)
    rate = diags_array((-1.0, 1.0), offsets=(0, 1), shape=(frames - 1, frames)) * at.fps
    between = diags_array(
        (-scale, scale), offsets=(0, 1), shape=(frames - 2, frames - 1)
    )
    halfway = (at.angular_matrices[1:] + at.angular_matrices[:-1]) / 2
    change = _per_axis(between, 3) @ _blocks(halfway) @ _per_axis(rate, 6)
    total = at.forces.sum(axis=1)
    shifted = (_blocks(_cross_matrices(total) @ at.com_matrices) / at.height).tocsr()
    arms = (at.soles[frame, foot] - at.com[frame]) / at.height
    sums = _per_axis(_inner_sums(frame, frames), 3)
    now = np.diff(at.angular, axis=0) * scale
    moments = -sums @ _blocks(_cross_matrices(arms))
    return hstack((change - shifted[3:-3], moments)), -now.ravel()


def _correction_costs(
    at: Linearization, feet: int, config: GroundingConfig
) -> list[_Rows]:
    """Returns the costs of the trunk's correction, of all steps, and of the joints'."""
    frames = len(at.com)
    size = np.repeat((config.turn, config.shift), 3)
    trunk = diags_array(np.tile(1 / size, frames))
    weight = (2 * np.sin(np.pi * config.smoothness / at.fps)) ** -3
    jerk = weight * _per_axis(difference_matrix(frames), 6) @ trunk
    joints = _blocks(at.joint_matrices) / config.joint
    gone = at.moved.ravel()
    return [
        (_of_steps(trunk, feet), -trunk @ gone),
        (_of_steps(jerk, feet), -jerk @ gone),
        (_of_steps(joints, feet), -at.joints_moved.ravel() / config.joint),
    ]


def _force_changes(contacts: Bools) -> _Rows:
    """Returns the change of each force from frame to frame, also from and to 0."""
    frames = len(contacts)
    first = diags_array((-1.0, 1.0), offsets=(0, 1), shape=(frames - 1, frames))
    chosen = csr_matrix(eye_array(4 * frames))[np.flatnonzero(contacts)]
    changes = csr_matrix(_per_axis(first, 4)) @ chosen.T
    changes = _per_axis(changes[np.diff(changes.indptr) > 0], 3)
    none = csc_matrix((changes.shape[0], 6 * frames))
    return hstack((none, changes)), np.zeros(changes.shape[0])


def _limits(at: Linearization, feet: int) -> _Rows:
    """Returns rows and most values that keep joints and knees within their limits.

    What is beyond its limit already may stay there.
    """
    frames = len(at.com)
    J = _blocks(at.joint_matrices)
    knees = _blocks(at.knee_matrices)
    first = diags_array((-1.0, 1.0), offsets=(0, 1), shape=(frames - 1, frames))
    steps = _per_axis(first, at.joints.shape[1])
    change = np.diff(at.joints, axis=0)
    kept = []
    for rows, room in (
        (J, at.joint_upper - at.joints),
        (-J, at.joints - at.joint_lower),
        (steps @ J, at.joint_step - change),
        (-steps @ J, at.joint_step + change),
        (-knees, at.knees),
    ):
        near = np.flatnonzero(room < _NEAR)
        kept.append((csr_matrix(rows)[near], np.maximum(room.ravel()[near], 0.0)))
    rows = _of_steps(vstack([rows for rows, _ in kept]), feet)
    return rows, np.concatenate([room for _, room in kept])


def _cones(frames: int, feet: int, config: GroundingConfig) -> _Rows:
    """Returns rows and most values of forces within friction, and not too large."""
    turn = 2 * np.pi * np.arange(_EDGES) / _EDGES
    inner = np.full(_EDGES, -config.friction * np.cos(np.pi / _EDGES))
    facets = np.stack((np.cos(turn), np.sin(turn), inner), axis=1)
    facets = np.vstack((facets, [0.0, 0.0, 1.0]))
    most = np.r_[np.zeros(_EDGES), config.most_force]
    rows = kron(eye_array(feet), facets)
    none = csc_matrix((rows.shape[0], 6 * frames))
    return hstack((none, rows)), np.tile(most, feet)


def _weighted(rows: csc_matrix, right: Array, size: float) -> _Rows:
    return rows / size, right / size


def _of_steps(rows: csc_matrix, feet: int) -> csc_matrix:
    """Returns rows over x as rows over [x, f]."""
    return hstack((rows, csc_matrix((rows.shape[0], 3 * feet))))


def _inner_sums(frame: Integers, frames: int) -> csc_matrix:
    """Returns the matrix (T - 2, N) that sums over the feet of each inner frame."""
    ones = np.ones(len(frame))
    sums = csr_matrix((ones, (frame, np.arange(len(frame)))), (frames, len(frame)))
    return sums[1:-1]


def _per_axis(matrix: csc_matrix, axes: int) -> csc_matrix:
    return csc_matrix(kron(matrix, eye_array(axes)))


def _blocks(matrices: Array) -> csc_matrix:
    """Returns the block diagonal matrix of ``matrices`` (K, m, n)."""
    count, m, n = matrices.shape
    if not count:
        return csc_matrix((0, 0))
    index = np.arange(count + 1)
    return csc_matrix(
        bsr_array((matrices, index[:-1], index), shape=(count * m, count * n))
    )


def _cross_matrices(a: Array) -> Array:
    """Returns the matrices [a x] with [a x] b = a x b, shape (..., 3, 3)."""
    matrices = np.zeros((*a.shape, 3))
    x, y, z = np.moveaxis(a, -1, 0)
    matrices[..., 0, 1], matrices[..., 0, 2], matrices[..., 1, 2] = -z, y, -x
    matrices[..., 1, 0], matrices[..., 2, 0], matrices[..., 2, 1] = z, -y, x
    return matrices
