"""Correction of the formula's targets so that a humanoid can follow them.

The rules are those of :mod:`.correction`: what is on the ground stands still there,
swings above it, and all moves smoothly. A sole has two ends, so it also rolls:

* Its pitch is 0 while heel and toe are down, if the ankle can turn so far, and such
  that the end that is down is the lower one while one is; its heading is constant in
  each contact.
* The end that is down stands still. With Y the point that would be the heel if the foot
  were flat on its lower end, the middle of the sole is p = Y + g, where g follows from
  heading and pitch. So one problem, as that of a toe, finds Y, which is constant in
  each contact and never under the ground, while p is smooth.
* The pelvis is lowered, gently, where a leg would be too short.
"""

from dataclasses import replace

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.rotations import quat_rotate
from loco_drake.models.biped import Biped
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.biped_scaling import BipedTargets, direction
from loco_drake.retargeting.correction import (
    RAMP_SECONDS,
    fit_constant,
    fit_held,
    gentle_envelope,
    plant_feet,
    smooth,
    smoothness_matrix,
)
from loco_drake.retargeting.scaling import RetargetConfig

# A leg is at most this long over its length when straight: straight knees are fast.
STRETCH = 0.985


def correct(
    formula: BipedTargets,
    contacts: Bools,
    bent: Bools,
    robot: Biped,
    config: RetargetConfig,
) -> BipedTargets:
    """Returns targets at 50 Hz that a humanoid can follow, near to the formula's.

    ``contacts`` (T, 4) are those of toes left and right, and of heels; ``bent`` (T, 2)
    says of which feet ankles cannot turn so far that they are flat.
    """
    base, toes = config.smoothing.base, config.smoothing.toes
    q = smooth(formula.q_WB, base, FPS)
    down = contacts[:, :2] | contacts[:, 2:]
    pitch, yaw = roll_feet(formula, contacts, bent, toes)
    targets = BipedTargets(
        p_WB=smooth(formula.p_WB, base, FPS),
        q_WB=q / np.linalg.norm(q, axis=-1, keepdims=True),
        p_WS=plant_soles(formula.p_WS, yaw, pitch, down, robot, toes),
        yaw=yaw,
        pitch=pitch,
        p_BUpper=smooth(formula.p_BUpper, toes, FPS),
    )
    return lower_pelvis(targets, robot)


def roll_feet(
    formula: BipedTargets, contacts: Bools, bent: Bools, cutoff: float
) -> tuple[Array, Array]:
    """Returns pitches and headings of the feet, (T, 2) in rad, that suit contacts."""
    S = smoothness_matrix(len(contacts), cutoff, FPS)
    toes, heels = contacts[:, :2], contacts[:, 2:]
    pitch, yaw = np.empty_like(formula.pitch), np.empty_like(formula.yaw)
    for k in range(pitch.shape[1]):
        flat = toes[:, k] & heels[:, k]
        # With a heel that has to rise, the foot stands on its toe.
        level = np.where(bent[:, k], np.minimum(formula.pitch[:, k], 0.0), 0.0)
        pitch[:, k] = (
            level if flat.all() else fit_held(formula.pitch[:, k], flat, level, S)
        )
        down = toes[:, k] | heels[:, k]
        yaw[:, k] = fit_constant(formula.yaw[:, k, None], down, S)[:, 0]
    pitch = np.where(heels & ~toes, np.maximum(pitch, 0.0), pitch)
    return np.where(toes & ~heels, np.minimum(pitch, 0.0), pitch), yaw


def plant_soles(
    p_WS: Array, yaw: Array, pitch: Array, down: Bools, robot: Biped, cutoff: float
) -> Array:
    """Returns middles of the soles (T, 2, 3) whose lower ends stand still in contact.

    ``p_WS`` are the formula's, m; headings and pitches (T, 2) are in rad, and ``down``
    (T, 2) says which feet are on the ground.
    """
    length = robot.sole_length
    ahead = direction(yaw, pitch)
    flat = direction(yaw, np.zeros_like(pitch))
    on_heel = (pitch >= 0)[..., None]
    g = np.where(on_heel, ahead * length / 2, flat * length - ahead * length / 2)
    # min |Y + g - p|^2 + w |D (Y + g)|^2 has the slope S Y - (p - S g).
    S = smoothness_matrix(len(p_WS), cutoff, FPS)
    target = p_WS - (S @ g.reshape(len(g), -1)).reshape(g.shape)
    return g + plant_feet(target, down, robot.foot_radius, cutoff, FPS)


def lower_pelvis(targets: BipedTargets, robot: Biped) -> BipedTargets:
    """Returns targets with the pelvis lowered where a leg would be too short."""
    hips = targets.p_WB[:, None] + quat_rotate(targets.q_WB[:, None], robot.p_BReach)
    away = hips - targets.ankles(robot)
    across = (away[..., :2] ** 2).sum(axis=-1)
    longest = (STRETCH * robot.leg_reach) ** 2
    allowed = np.sqrt(np.maximum(longest - across, 0.0))
    missing = np.maximum(away[..., 2] - allowed, 0.0).max(axis=1)
    lift = gentle_envelope(missing, round(RAMP_SECONDS * FPS))
    p_WB = targets.p_WB - lift[:, None] * np.array([0.0, 0.0, 1.0])
    return replace(targets, p_WB=p_WB)
