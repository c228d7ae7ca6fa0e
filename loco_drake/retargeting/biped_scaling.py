"""The paper's formula for a body on two legs: keypoints -> targets for a humanoid.

The tree is another, the formula is that of :mod:`.scaling`: directions along the tree
are kept, lengths are scaled. The legs' scale is the ratio of stance heights; arms reach
for nothing, so each of their bones has the robot's own length. With the pelvis P midway
between the hips, and H its stance height::

    alpha  = hip_height of the robot / H
    R_WB   : y from the right hip to the left one, z toward the waist
    p_WP   = alpha P + (0, 0, base_height_offset)
    p_WS   = p_WV + alpha (M - A)     M the middle of the sole, A the hip, and V the
                                      robot's, above the middle of its sole
    S_z    : the lowest end of the sole is at foot_radius + swing_height alpha max(z, 0)
    R_BC   : of the chest, y along the shoulders, z from waist to neck
    p_BE   = p_BS + l u               u the direction from shoulder S to elbow E, l the
                                      robot's; so the wrist

A foot keeps its heading and pitch; its roll is 0, since soles are to stand flat.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import quat_continuous, quat_rotate
from loco_drake.models.biped import Biped
from loco_drake.motion.biped_clip import BipedClip
from loco_drake.retargeting.scaling import RetargetConfig, along_tree


@dataclass(frozen=True)
class BipedTargets:
    """Where a humanoid's parts are to be over T frames; left before right."""

    p_WB: Array  # position of the pelvis in m, shape (T, 3)
    q_WB: Array  # its orientation, quaternions w, x, y, z, shape (T, 4)
    p_WS: Array  # middles of the soles, of their spheres' centres, m, shape (T, 2, 3)
    yaw: Array  # headings of the feet in rad, without jumps, shape (T, 2)
    pitch: Array  # of the feet in rad, toe up above 0, shape (T, 2)
    # Shoulders, a point ahead of them, elbows and wrists, m, shape (T, 7, 3).
    p_BUpper: Array

    def foot_points(self, robot: Biped) -> Array:
        """Returns left and right end of the toe, and the heel, in W, (T, 2, 3, 3)."""
        forward, left, up = self._foot_axes()
        p_F = foot_marks(robot) - robot.sole_middle
        points = p_F[:, :1] * forward[..., None, :] + p_F[:, 1:2] * left[..., None, :]
        return self.p_WS[:, :, None] + points + p_F[:, 2:] * up[..., None, :]

    def ankles(self, robot: Biped) -> Array:
        """Returns the origins of the feet's frames in W, m, shape (T, 2, 3)."""
        forward, left, up = self._foot_axes()
        x, y, z = -robot.sole_middle
        return self.p_WS + x * forward + y * left + z * up

    def _foot_axes(self) -> tuple[Array, Array, Array]:
        forward = direction(self.yaw, self.pitch)
        left = direction(self.yaw + np.pi / 2, np.zeros_like(self.pitch))
        return forward, left, np.cross(forward, left)


def foot_marks(robot: Biped) -> Array:
    """Returns the points that place a foot, in its frame, m, shape (3, 3)."""
    aside = np.array([0.0, robot.sole_half_width, 0.0])
    return np.array([robot.toe + aside, robot.toe - aside, robot.heel])


def upper_marks(robot: Biped) -> tuple[tuple[str, Array], ...]:
    """Returns frame and position in it, m, of the seven points of the upper body."""
    chest = [(robot.chest_frame, p) for p in _chest_marks(robot)]
    ends = [arm[k] for k in (0, 1) for arm in robot.arm_frames]
    return (*chest, *((frame, np.zeros(3)) for frame in ends))


def direction(yaw: Array, pitch: Array) -> Array:
    """Returns the unit vectors (..., 3) of headings and pitches in rad, up above 0."""
    across = np.cos(pitch)
    parts = (across * np.cos(yaw), across * np.sin(yaw), np.sin(pitch))
    return np.stack(parts, axis=-1)


def scale_to_biped(
    clip: BipedClip, height: float, robot: Biped, config: RetargetConfig
) -> BipedTargets:
    """Returns the targets by the formula above, one frame for each of the clip's.

    ``height`` is the person's stance height H in m.
    """
    alpha = robot.hip_height / height
    R_WB = _frames(clip.hips[:, 0] - clip.hips[:, 1], clip.spine[:, 1] - clip.middle)
    q_WB = quat_continuous(_quaternions(R_WB))
    p_WP = alpha * clip.middle
    p_WP[:, 2] += config.base_height_offset
    p_WB = p_WP - quat_rotate(q_WB, robot.p_BHip.mean(axis=0))

    forward = clip.forward[:, None]
    left = np.stack((-forward[..., 1], forward[..., 0], forward[..., 2]), axis=-1)
    sides = np.array([1.0, -1.0])[:, None]
    p_WA = clip.hips + height * (
        config.front_hip * forward + config.hip_spread * sides * left
    )
    p_WV = p_WB[:, None] + quat_rotate(q_WB[:, None], robot.p_BV)
    ankle, heel, toe = np.moveaxis(clip.legs[:, :, 2:], 2, 0)
    p_WS = along_tree(p_WV, p_WA, (heel + toe) / 2, alpha)
    yaw, pitch = _foot_angles(ankle, heel, toe)
    lift = config.swing_height * alpha * np.minimum(heel, toe)[..., 2].clip(0.0)
    half = robot.sole_length / 2 * np.abs(np.sin(pitch))
    p_WS[..., 2] = robot.foot_radius + lift + half
    return BipedTargets(p_WB, q_WB, p_WS, yaw, pitch, _upper(clip, R_WB, robot))


def _upper(clip: BipedClip, R_WB: Array, robot: Biped) -> Array:
    """Returns the targets of the upper body in B, m, shape (T, 7, 3)."""
    shoulders = clip.arms[:, :, 0]
    R_WC = _frames(
        shoulders[:, 0] - shoulders[:, 1], clip.spine[:, 2] - clip.spine[:, 1]
    )
    R_BC = np.swapaxes(R_WB, 1, 2) @ R_WC
    chest = robot.p_BChest + _chest_marks(robot) @ np.swapaxes(R_BC, 1, 2)
    arms_B = clip.arms @ R_WB[:, None]
    bones = np.diff(arms_B, axis=2)
    scale = robot.arm_lengths[..., None] / np.linalg.norm(bones, axis=-1, keepdims=True)
    elbows = along_tree(chest[:, :2], arms_B[:, :, 0], arms_B[:, :, 1], scale[:, :, 0])
    wrists = along_tree(elbows, arms_B[:, :, 1], arms_B[:, :, 2], scale[:, :, 1])
    return np.concatenate((chest, elbows, wrists), axis=1)


def _chest_marks(robot: Biped) -> Array:
    """Returns shoulders and a point ahead of them in C, m, shape (3, 3)."""
    left, right = robot.p_CShoulder
    ahead = np.array([np.linalg.norm(left - right) / 2, 0.0, 0.0])
    return np.array([left, right, (left + right) / 2 + ahead])


def _foot_angles(ankle: Array, heel: Array, toe: Array) -> tuple[Array, Array]:
    """Returns headings and pitches of feet, each (T, 2) in rad, without jumps.

    The axis about which a foot pitches, from right to left, is normal to its sole's
    line and the ankle, and so known if toes point straight down, too.
    """
    sole = toe - heel
    left = np.cross(ankle - heel, sole)
    yaw = np.unwrap(np.arctan2(-left[..., 0], left[..., 1]), axis=0)
    ahead = sole[..., 0] * np.cos(yaw) + sole[..., 1] * np.sin(yaw)
    return yaw, np.arctan2(sole[..., 2], ahead)


def _frames(left: Array, up: Array) -> Array:
    """Returns rotations (T, 3, 3) with y along ``left`` and z near ``up``, (T, 3)."""
    y = left / np.linalg.norm(left, axis=-1, keepdims=True)
    x = np.cross(y, up)
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack((x, y, np.cross(x, y)), axis=-1)


def _quaternions(R: Array) -> Array:
    xyzw = Rotation.from_matrix(R).as_quat()
    return np.asarray(xyzw[..., [3, 0, 1, 2]], dtype=np.float64)
