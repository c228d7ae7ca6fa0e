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

By default a robot keeps the animal's timing, as in the paper, so that a small robot
moves like a large animal in slow motion. Two bodies, small and large, move alike
dynamically if their Froude numbers v^2 / (g h) are equal (Alexander and Jayes 1983, "A
dynamic similarity hypothesis for the gaits of quadrupedal mammals"): with lengths alpha
times those of the animal, times are sqrt(alpha) times its own, and so are speeds. Noise
and the thresholds of a contact are the recording's and so belong to the animal's clock:
contacts are found before the clock is changed, and cut-off frequencies change with it.
The clearance of a swing and the limits of the joints are the robot's.
"""

from dataclasses import dataclass, replace
from math import sqrt

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
from loco_drake.common.runs import intervals
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.source_config import RetargetConfig

Array = NDArray[np.float64]

# An animal is on its feet where the heights of withers and hip, over the distances of
# their toes, are above UPRIGHT, the legs are longer than UNFOLDED of the longest they
# are, and the trunk's height is above OFF_THE_GROUND of its length. In the stretches of
# dog and horse the least are .82 (a gallop), .74 (a canter) and .95. Of a dog that sits
# the hip is at .3; of one that lies both are at .1 to .6, and it is at .1 to .45 of its
# length.
UPRIGHT, UNFOLDED, OFF_THE_GROUND = 0.75, 0.65, 0.45
# Withers and hip differ in height by less than this of the trunk's length; .26 there.
STEEP = 0.6
LEAST_STANDING = 0.2  # s

_MOST_RUNS = 5


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


def on_feet(clip: KeypointClip) -> NDArray[np.bool_]:
    """Returns in which frames the animal stands on its feet, shape (T,).

    In these, withers and hip are about as high as they are far from their toes, the
    legs are not folded, and the trunk is neither on the ground nor steep. A sitting
    animal has a low hip; a lying one has its legs folded or to the side.
    """
    front = np.linalg.norm(clip.toes[:, :2] - clip.withers[:, None], axis=-1).mean(1)
    rear = np.linalg.norm(clip.toes[:, 2:] - clip.hip[:, None], axis=-1).mean(1)
    height = (clip.withers[:, 2] + clip.hip[:, 2]) / 2
    trunk = np.median(np.linalg.norm(clip.withers - clip.hip, axis=-1))
    upright = (
        (clip.withers[:, 2] > UPRIGHT * front)
        & (clip.hip[:, 2] > UPRIGHT * rear)
        & (height > OFF_THE_GROUND * trunk)
        & (np.abs(clip.withers[:, 2] - clip.hip[:, 2]) < STEEP * trunk)
    )
    legs = front + rear
    longest = legs[upright].max(initial=0.0)
    return upright & (legs > UNFOLDED * longest)


def track_width(clip: KeypointClip) -> float:
    """Returns the mean lateral distance of the left toes from the right ones, m."""
    ahead = (clip.withers - clip.hip)[:, :2]
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=-1)
    left = left / np.maximum(np.linalg.norm(left, axis=-1, keepdims=True), 1e-9)
    apart = (clip.toes[:, 0::2] - clip.toes[:, 1::2])[..., :2].mean(axis=1)
    return float((apart * left).sum(axis=-1).mean())


def frames_on_feet(clip: KeypointClip, standing: NDArray[np.bool_]) -> str:
    """Returns these frames as numbers of the recording, such as "240-420"."""
    first = int(clip.provenance.get("frames", "0").split("-")[0])
    runs = [f"{first + start}-{first + end}" for start, end in intervals(standing)]
    if len(runs) > _MOST_RUNS:
        runs = [*runs[:_MOST_RUNS], f"{len(runs) - _MOST_RUNS} more"]
    return ", ".join(runs)


def stance_height(clip: KeypointClip, config: RetargetConfig) -> float:
    """Returns the animal's stance height in m: of the middle of withers and hip.

    It is that of the configuration, or else a percentile over the frames in which the
    animal is on its feet.

    Raises:
        InputError: if the middle lies below the ground, or the animal is on its feet in
            too few frames to tell its size, naming these.
    """
    middle = (clip.withers[:, 2] + clip.hip[:, 2]) / 2
    lowest = float(np.percentile(middle, config.stance_height_percentile))
    if lowest <= 0:
        raise InputError(
            f"The middle of withers and hip lies {lowest:.3g} m over the ground, "
            "so this is no clip of an animal on its feet."
        )
    if config.stance_height is not None:
        return config.stance_height
    standing = on_feet(clip)
    if not standing.all() and standing.sum() < LEAST_STANDING * clip.fps:
        where = frames_on_feet(clip, standing)
        raise InputError(
            "The animal is on its feet in "
            + (f"no frames but {where}" if where else "no frame")
            + ", too few to tell how high it stands: its withers and hip must be over "
            "its toes for its size to be known."
        )
    return float(np.percentile(middle[standing], config.stance_height_percentile))


def resample(clip: KeypointClip, fps: float) -> KeypointClip:
    """Returns the clip at ``fps``, interpolated by cubic splines.

    Raises:
        InputError: if it has fewer than 4 frames.
    """
    if len(clip) < 4:
        raise InputError(f"A clip needs at least 4 frames, not {len(clip)}.")
    duration = (len(clip) - 1) / clip.fps
    old = np.arange(len(clip)) / clip.fps
    # A tolerance, so that a duration of whole steps keeps its last frame.
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
        robot: the robot.
        config: configuration of the clip's source.
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


@dataclass(frozen=True)
class Variant:
    """Changes to a recording; none by default.

    Attributes:
        mirror: whether left and right are exchanged.
        froude: whether time is scaled for the animal's Froude number.
    """

    mirror: bool = False
    froude: bool = False

    @property
    def suffix(self) -> str:
        """Suffix of a folder with such motion: "-mirrored-froude"."""
        return "-mirrored" * self.mirror + "-froude" * self.froude

    def time_scale(self, scale: float) -> float:
        """Returns the duration of the motion over that of the recording.

        Args:
            scale: the robot's stance height over the animal's.
        """
        return sqrt(scale) if self.froude else 1.0

    def apply(self, clip: KeypointClip, scale: float) -> KeypointClip:
        """Returns the clip in the robot's time, mirrored if requested."""
        clip = clip.mirrored() if self.mirror else clip
        return in_time(clip, self.time_scale(scale))


AS_RECORDED = Variant()


def in_time(clip: KeypointClip, time_scale: float) -> KeypointClip:
    """Returns the clip on a clock that makes it ``time_scale`` times as long."""
    return replace(
        clip,
        fps=clip.fps / time_scale,
        provenance={**clip.provenance, "time_scale": f"{time_scale:.6g}"},
    )


def smoothing_in_time(config: RetargetConfig, time_scale: float) -> RetargetConfig:
    """Returns the configuration with its cut-offs in Hz on that clock."""
    smoothing = replace(
        config.smoothing,
        base=config.smoothing.base / time_scale,
        toes=config.smoothing.toes / time_scale,
    )
    return replace(config, smoothing=smoothing)
