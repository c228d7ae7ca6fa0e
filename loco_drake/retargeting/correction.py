"""Correction of the formula's targets so that a robot can follow them.

Toes stand still in stance, swing above the ground and are within reach, trunk and toes
move smoothly, and the trunk is high enough for legs to fold and knees to clear the
ground.

*Toes.* For each leg, the result is the trajectory nearest to the formula's with small
third differences and a fixed position in each contact. Footholds and swings are
optimized together, so touchdown and lift-off are smooth:

    min  sum_t |p_t - target_t|^2 + w |D p|^2
    s.t. p_t = p_(t+1) within each contact;  p_t,z = foot_radius in contact;
         p_t,z >= foot_radius + clearance_t in swing.

*Trunk.* A robot whose knees all point backward cannot copy the low crawl of one whose
knees point at each other: a foot far ahead of its hip would put the knee on the ground.
The trunk is raised where legs would fold too much or kneel.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.sparse import csc_matrix, csr_matrix, diags_array, eye_array
from scipy.sparse.linalg import splu, spsolve

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.rotations import quat_rotate
from loco_drake.common.runs import intervals
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.scaling import RetargetConfig, Targets

_ORDER = 3  # of the differences that are small

# Toes swing at least this high over the ground, in m, at mid-swing; and at least as
# high as a swing that takes off and lands with this vertical acceleration, in m/s^2.
CLEARANCE = 0.015
LIFT_ACCELERATION = 20.0

_MAX_ROUNDS = 20

# A leg in stance right under its hip is at least this much longer than fully folded.
FOLD_MARGIN = 1.1
# Height of the knees' axes over the ground in m: the thigh's radius and some air.
KNEE_CLEARANCE = 0.03
# Over this time before and after a lift the trunk rises and sinks, s.
RAMP_SECONDS = 0.14

_MAX_LIFTS = 6
_CLOSE_ENOUGH = 0.002


def correct(
    formula: Targets,
    contacts: Bools,
    robot: Quadruped,
    config: RetargetConfig,
) -> Targets:
    """Returns targets at 50 Hz that a robot can follow, near to the formula's."""
    smoothing = config.smoothing
    targets = Targets(
        p_WB=smooth(formula.p_WB, smoothing.base, FPS),
        yaw=smooth(formula.yaw, smoothing.base, FPS),
        pitch=smooth(formula.pitch, smoothing.base, FPS),
        p_WF=plant_feet(formula.p_WF, contacts, robot.foot_radius, smoothing.toes, FPS),
    )
    return within_reach(raise_trunk(targets, robot, FPS), robot)


def within_reach(targets: Targets, robot: Quadruped) -> Targets:
    """Returns ``targets`` with toes moved within reach of the joint limits.

    See :meth:`loco_drake.models.quadruped.Quadruped.reachable_toes`.
    """
    p_BF = targets.p_BF
    reachable = robot.reachable_toes(p_BF)
    beyond = np.linalg.norm(reachable - p_BF, axis=-1, keepdims=True) > 1e-9
    p_WF = targets.p_WB[:, None] + quat_rotate(targets.q_WB[:, None], reachable)
    return replace(targets, p_WF=np.where(beyond, p_WF, targets.p_WF))


def difference_matrix(frames: int) -> csc_matrix:
    """Returns D, shape (frames - 3, frames), of third differences."""
    rows = frames - _ORDER
    if rows <= 0:
        return csc_matrix((0, frames))
    stencil = (-1.0, 3.0, -3.0, 1.0)
    return csc_matrix(
        diags_array(stencil, offsets=range(_ORDER + 1), shape=(rows, frames))
    )


def penalty(cutoff: float, fps: float) -> float:
    """Returns the weight of squared third differences for a cut-off in Hz.

    min |x - y|^2 + w |D x|^2 is the low-pass filter 1 / (1 + w (2 sin(pi f / fps))^6),
    like a Butterworth filter without phase; it halves the amplitude at the cut-off. A
    cut-off above half the rate disables it.
    """
    if cutoff >= fps / 2:
        return 0.0
    return float((2 * np.sin(np.pi * cutoff / fps)) ** (-2 * _ORDER))


def smoothness_matrix(frames: int, cutoff: float, fps: float) -> csc_matrix:
    """Returns S = 1 + w D' D, (frames, frames): half the slope of what is minimized."""
    D = difference_matrix(frames)
    return penalty(cutoff, fps) * (D.T @ D) + eye_array(frames)


def smooth(values: Array, cutoff: float, fps: float) -> Array:
    """Returns ``values`` (T, ...) after a zero-phase low-pass along the first axis.

    This is Whittaker's smoother, see :func:`penalty`. Quadratics pass unchanged, also
    at the ends.
    """
    frames = len(values)
    D = difference_matrix(frames)
    system = eye_array(frames, format="csc") + penalty(cutoff, fps) * (D.T @ D)
    smoothed = splu(csc_matrix(system)).solve(values.reshape(frames, -1))
    return np.reshape(smoothed, values.shape)


def plant_feet(
    p_WF: Array, contacts: Bools, foot_radius: float, cutoff: float, fps: float
) -> Array:
    """Returns toes (T, N, 3) that stand still in contact and swing above the ground.

    ``p_WF`` are the formula's targets in m, ``contacts`` (T, N) say which toes are on
    the ground, and ``cutoff`` is that of the smoothing in Hz.
    """
    smoothness = smoothness_matrix(len(p_WF), cutoff, fps)
    planted = np.empty_like(p_WF)
    for leg in range(contacts.shape[1]):
        target, contact = p_WF[:, leg], contacts[:, leg]
        planted[:, leg, :2] = fit_constant(target[:, :2], contact, smoothness)
        floor = foot_radius + swing_clearance(contact, fps)
        planted[:, leg, 2] = _fit_height(target[:, 2], contact, floor, smoothness)
    return planted


def swing_clearance(contact: Bools, fps: float) -> Array:
    """Returns the minimum height of a swinging toe over the ground, m, shape (T,).

    It is zero in contact and at the ends of each swing, and :data:`CLEARANCE` at
    mid-swing if the swing is long enough. The clip's ends count as mid-swing.
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


def fit_constant(target: Array, contact: Bools, smoothness: csc_matrix) -> Array:
    """Returns values (T, n) near to ``target`` that are constant in each contact."""
    frames = len(target)
    # A value differs from that of the frame before, but within a contact.
    columns = np.r_[0, np.cumsum(~(contact[1:] & contact[:-1]))]
    M = csr_matrix((np.ones(frames), (np.arange(frames), columns)))
    values = spsolve(csc_matrix(M.T @ smoothness @ M), M.T @ target)
    fitted: Array = M @ values.reshape(-1, target.shape[1])
    return fitted


def _fit_height(
    target: Array, contact: Bools, floor: Array, smoothness: csc_matrix
) -> Array:
    """Returns z (T,) nearest to ``target``, at ``floor`` in contact, never below it.

    An active-set method: frames that would sink are held at the floor, until none does.
    """
    held = contact.copy()
    height = floor.copy()
    for _ in range(_MAX_ROUNDS):
        if held.all():
            break
        height = fit_held(target, held, floor, smoothness)
        sunk = height < floor - 1e-9
        if not sunk.any():
            break
        held |= sunk
    return np.maximum(height, floor)


def fit_held(
    target: Array, held: Bools, values: Array, smoothness: csc_matrix
) -> Array:
    """Returns values (T,) near to ``target``, those that are held at ``values``."""
    free = ~held
    coupling = smoothness.tocsr()[free]
    right = target[free] - coupling[:, held] @ values[held]
    fitted = values.copy()
    fitted[free] = spsolve(csc_matrix(coupling[:, free]), right)
    return fitted


def raise_trunk(targets: Targets, robot: Quadruped, fps: float) -> Targets:
    """Returns ``targets`` with the trunk raised where the legs need it.

    This is where a hip is so low that a leg below it could not fold enough, or a knee
    is lower than :data:`KNEE_CLEARANCE`. Heading, pitch and toes are kept; the trunk
    rises and sinks gently.
    """
    lowest_hip = robot.foot_radius + FOLD_MARGIN * robot.folded_length
    ramp = round(RAMP_SECONDS * fps)
    for _ in range(_MAX_LIFTS):
        hips, knees = _hip_and_knee_heights(targets, robot)
        missing = np.maximum(lowest_hip - hips, KNEE_CLEARANCE - knees)
        if missing.max() < _CLOSE_ENOUGH:
            break
        lift = gentle_envelope(np.maximum(missing, 0.0), ramp)
        up = np.array([0.0, 0.0, 1.0])
        targets = replace(targets, p_WB=targets.p_WB + lift[:, None] * up)
    return targets


def _hip_and_knee_heights(targets: Targets, robot: Quadruped) -> tuple[Array, Array]:
    """Returns the heights in m of the lowest hip and the lowest knee, each (T,)."""
    p_BKnee = robot.knee_positions(robot.nearest_joints(targets.p_BF))
    p_BPoints = np.stack((np.broadcast_to(robot.p_BHip, p_BKnee.shape), p_BKnee))
    lowest = quat_rotate(targets.q_WB[:, None], p_BPoints)[..., 2].min(axis=-1)
    hips, knees = targets.p_WB[:, 2] + lowest
    return hips, knees


def gentle_envelope(values: Array, ramp: int) -> Array:
    """Returns a smooth curve that is nowhere below ``values`` (T,).

    The moving averages are no wider than the preceding moving maximum, so each averaged
    value is at least the value of the middle frame.
    """
    half = ramp // 2
    envelope: Array = maximum_filter1d(values, 4 * half + 1, mode="nearest")
    for _ in range(2):
        envelope = uniform_filter1d(envelope, 2 * half + 1, mode="nearest")
    return envelope
