"""The paper's formula: an animal's keypoints -> targets for a robot's trunk and toes.

Unit directions along the animal's kinematic tree (hip or withers -> virtual hip joint
-> toe) are kept, lengths are scaled by the ratio of the stance heights. In symbols,
with w and h the withers and the hip, heights over the ground, R(psi, theta) = Rz(psi)
Ry(theta):

    alpha    = stand_height of the robot / stance height H of the animal
    psi      = atan2(w_y - h_y, w_x - h_x)                      heading
    theta    = -atan2(w_z - h_z, hypot(w_x - h_x, w_y - h_y))   pitch, nose down > 0
    p_WB     = alpha (w + h) / 2 + (0, 0, base_height_offset)   roll is 0
    p_WA     = w + front_hip H d +- hip_spread H s              the animal's virtual
               h + rear_hip H d +- hip_spread H s               hips, front and rear
    p_WV     = p_WB + R p_BV                                    the robot's
    p_WF_xy  = (p_WV + alpha |p_WT - p_WA| u)_xy                T the animal's toe
    p_WF_z   = foot_radius + swing_height alpha max(T_z, 0)     the toe's height is kept

where d is the unit vector from hip to withers, s the horizontal one to its left and u
the one from A to T. The robot's virtual hip V is its thigh joint at zero abduction (or
above the toe of its stance, where the legs have other joints), so that an animal whose
toes fall under its virtual hips stands with the robot's legs straight down.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import (
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    yaw_quat,
)
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.source_config import RetargetConfig

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Targets:
    """Where a robot's trunk and toes are to be over T frames.

    Attributes:
        p_WB: position of the trunk in m, shape (T, 3).
        yaw: heading of the trunk in rad, without jumps, shape (T,).
        pitch: of the trunk in rad, nose down above 0, shape (T,).
        p_WF: centres of the toe spheres in m, shape (T, 4, 3).
    """

    p_WB: Array
    yaw: Array
    pitch: Array
    p_WF: Array

    @property
    def q_WB(self) -> Array:
        """Orientation of the trunk as quaternions w, x, y, z, shape (T, 4)."""
        zero = np.zeros_like(self.pitch)
        half = self.pitch / 2
        pitch = np.stack((np.cos(half), zero, np.sin(half), zero), axis=-1)
        return quat_multiply(yaw_quat(self.yaw), pitch)

    @property
    def p_BF(self) -> Array:
        """Centres of the toe spheres in the trunk frame, m, shape (T, 4, 3)."""
        q_BW = quat_conjugate(self.q_WB)[:, None]
        return quat_rotate(q_BW, self.p_WF - self.p_WB[:, None])


def stance_height(clip: KeypointClip, config: RetargetConfig) -> float:
    """Returns the animal's stance height in m: of the middle of withers and hip.

    It is that of the configuration, or else a percentile over the clip.

    Raises:
        InputError: if the middle lies below the ground.
    """
    middle = (clip.withers[:, 2] + clip.hip[:, 2]) / 2
    height = float(np.percentile(middle, config.stance_height_percentile))
    if height <= 0:
        raise InputError(
            f"The middle of withers and hip lies {height:.3g} m over the ground, "
            "so this is no clip of an animal on its feet."
        )
    return height if config.stance_height is None else config.stance_height


def resample(clip: KeypointClip, fps: float) -> KeypointClip:
    """Returns the clip at ``fps``, interpolated by cubic splines.

    Raises:
        InputError: if it has fewer than 4 frames.
    """
    if len(clip) < 4:
        raise InputError(f"A clip needs at least 4 frames, not {len(clip)}.")
    duration = (len(clip) - 1) / clip.fps
    old = np.arange(len(clip)) / clip.fps
    # A hair's grace, so that a duration of whole steps keeps its last frame.
    new = np.arange(int(duration * fps + 1e-6) + 1) / fps
    withers, hip, toes = (
        CubicSpline(old, points)(new) for points in (clip.withers, clip.hip, clip.toes)
    )
    return replace(clip, fps=fps, withers=withers, hip=hip, toes=toes)


def scale_to_robot(
    clip: KeypointClip, height: float, robot: Quadruped, config: RetargetConfig
) -> Targets:
    """Returns the targets by the formula above, one frame for each of the clip's.

    Args:
        clip: ground at z = 0.
        height: the animal's stance height H in m.
        robot: whose trunk and toes.
        config: of the clip's source.
    """
    alpha = robot.stand_height / height
    trunk = clip.withers - clip.hip
    yaw = np.unwrap(np.arctan2(trunk[:, 1], trunk[:, 0]))
    pitch = -np.arctan2(trunk[:, 2], np.hypot(trunk[:, 0], trunk[:, 1]))
    p_WB = alpha * (clip.withers + clip.hip) / 2
    p_WB = p_WB + np.array([0.0, 0.0, config.base_height_offset])
    base = Targets(p_WB=p_WB, yaw=yaw, pitch=pitch, p_WF=np.empty((0, 4, 3)))

    d = (trunk / np.linalg.norm(trunk, axis=-1, keepdims=True)) * height
    front = clip.withers + config.front_hip * d
    rear = clip.hip + config.rear_hip * d
    s = np.stack((-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)), axis=-1)
    spread = config.hip_spread * height * np.sign(robot.p_BV[:, 1])
    p_WA = np.stack((front, front, rear, rear), axis=1) + spread[:, None] * s[:, None]
    p_WV = p_WB[:, None] + quat_rotate(base.q_WB[:, None], robot.p_BV)

    p_WF = p_WV + alpha * (clip.toes - p_WA)
    lift = config.swing_height * alpha * np.maximum(clip.toes[..., 2], 0.0)
    p_WF[..., 2] = robot.foot_radius + lift
    return replace(base, p_WF=p_WF)
