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

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, sqrt
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.interpolate import CubicSpline

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_bounds
from loco_drake.common.rotations import (
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    yaw_quat,
)
from loco_drake.common.typed import FieldError, convert
from loco_drake.common.typed_yaml import read_yaml
from loco_drake.datasets.registry import DATASETS, get_dataset
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.biped_clip import BipedClip
from loco_drake.motion.keypoints import KeypointClip

Clip = TypeVar("Clip", KeypointClip, BipedClip)

_SOURCES = Path(__file__).parent / "sources"


@dataclass(kw_only=True)
class ContactConfig:
    """Contact thresholds; see :mod:`loco_drake.retargeting.contacts`."""

    # A toe lands below the first height and leaves above the second, both as fractions
    # of the stance height.
    land_height: float = 0.05
    leave_height: float = 0.09
    # ... and when it is slower, or faster, than these fractions of the trunk's speed,
    # or than these speeds in m/s where that is more.
    land_speed_ratio: float = 0.35
    leave_speed_ratio: float = 0.5
    land_speed: float = 0.4
    leave_speed: float = 0.7
    # Shorter contacts and shorter flights are taken for noise; s.
    shortest_stance: float = 0.04
    shortest_swing: float = 0.06


@dataclass(kw_only=True)
class SmoothingConfig:
    """Cut-off frequencies of the zero-phase low-pass filters, in Hz."""

    # Of the trunk's position, heading and pitch.
    base: float = 5.0
    # Of the toes.
    toes: float = 7.0


@dataclass(kw_only=True)
class RetargetConfig:
    """Parameters that map the keypoints of one source to targets of a robot."""

    # The source's stance height in m, where all its clips are of one body that may
    # creep or stand tall. Without it, it is clip by clip this percentile of the height
    # of the middle between withers and hip.
    stance_height: float | None = None
    stance_height_percentile: float = 50.0
    # Where the virtual hip joints lie, on the line from hip to withers: ahead of the
    # withers and ahead of the hip, and to the sides of that line, as fractions of the
    # stance height.
    front_hip: float = 0.0
    rear_hip: float = 0.0
    hip_spread: float = 0.0
    # Added to the height of the robot's trunk, m.
    base_height_offset: float = 0.0
    # Multiplies the height of the toes beside the scale.
    swing_height: float = 1.0
    contact: ContactConfig = field(default_factory=ContactConfig)
    smoothing: SmoothingConfig = field(default_factory=SmoothingConfig)


def load_config(source: str) -> RetargetConfig:
    """Returns the configuration of a source: its dataset's, or the shipped one.

    A dataset that has neither gets the defaults.

    Raises:
        InputError: naming the sources that there are.
    """
    shipped = _SOURCES / f"{source}.yaml"
    if source not in DATASETS and shipped.is_file():  # a body on two legs
        return read_config(shipped)
    dataset = get_dataset(source)
    own = dataset.config
    if isinstance(own, Mapping):
        where = dataset.definition or f"the configuration of {source}"
        try:
            config: RetargetConfig = convert(own, RetargetConfig, numeric_text=True)
        except FieldError as error:
            raise InputError(f"{where}: retargeting: {error}.") from None
        return _checked(config, f"{where}: retargeting")
    if own is None and not shipped.is_file():
        return RetargetConfig()
    return read_config(own or shipped)


def read_config(path: Path) -> RetargetConfig:
    """Returns the configuration in a YAML file; fields not named keep their default.

    Raises:
        InputError: if the file is missing, names an unknown field, or holds a value
            that cannot be.
    """
    return _checked(
        read_yaml(path, RetargetConfig, "a retargeting configuration"), path
    )


def _checked(config: RetargetConfig, where: Path | str) -> RetargetConfig:
    """Returns the configuration; raises InputError if a value cannot be."""
    above_0 = {
        "swing_height": config.swing_height,
        "stance_height": 1.0 if config.stance_height is None else config.stance_height,
        **{f"smoothing.{key}": value for key, value in vars(config.smoothing).items()},
        **{f"contact.{key}": value for key, value in vars(config.contact).items()},
    }
    for name, value in above_0.items():
        check_bounds(f"{where}: {name}", value, 0, above=True)
    for name in ("front_hip", "rear_hip", "hip_spread", "base_height_offset"):
        if not isfinite(value := getattr(config, name)):
            raise InputError(f"{where}: {name} must be finite, not {value}.")
    if not 0 <= config.stance_height_percentile <= 100:
        raise InputError(f"{where}: stance_height_percentile must be within 0 to 100.")
    return config


@dataclass(frozen=True)
class Targets:
    """Where a robot's trunk and toes are to be over T frames."""

    p_WB: Array  # position of the trunk in m, shape (T, 3)
    yaw: Array  # heading of the trunk in rad, without jumps, shape (T,)
    pitch: Array  # of the trunk in rad, nose down above 0, shape (T,)
    p_WF: Array  # centres of the toe spheres in m, shape (T, 4, 3)

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


def resample(clip: KeypointClip, fps: float) -> KeypointClip:
    """Returns the clip at ``fps``, interpolated by cubic splines.

    Raises:
        InputError: if it has fewer than 4 frames.
    """
    points = (clip.withers, clip.hip, clip.toes)
    withers, hip, toes = resample_points(points, clip.fps, fps)
    return replace(clip, fps=fps, withers=withers, hip=hip, toes=toes)


def resample_points(
    points: Sequence[Array], fps: float, new_fps: float
) -> Iterator[Array]:
    """Yields arrays (T, ...) at another rate, interpolated by cubic splines.

    Raises:
        InputError: if they have fewer than 4 frames.
    """
    frames = len(points[0])
    if frames < 4:
        raise InputError(f"A clip needs at least 4 frames, not {frames}.")
    duration = (frames - 1) / fps
    old = np.arange(frames) / fps
    # A tolerance, so that a duration of whole steps keeps its last frame.
    new = np.arange(int(duration * new_fps + 1e-6) + 1) / new_fps
    return (CubicSpline(old, values)(new) for values in points)


def scale_to_robot(
    clip: KeypointClip, height: float, robot: Quadruped, config: RetargetConfig
) -> Targets:
    """Returns the targets by the formula above, one frame for each of the clip's.

    ``height`` is the animal's stance height H in m.
    """
    alpha = robot.stand_height / height
    trunk = clip.withers - clip.hip
    yaw = np.unwrap(np.arctan2(trunk[:, 1], trunk[:, 0]))
    pitch = -np.arctan2(trunk[:, 2], np.hypot(trunk[:, 0], trunk[:, 1]))
    p_WB = alpha * clip.middle
    p_WB[:, 2] += config.base_height_offset
    base = Targets(p_WB=p_WB, yaw=yaw, pitch=pitch, p_WF=np.empty((0, 4, 3)))

    d = (trunk / np.linalg.norm(trunk, axis=-1, keepdims=True)) * height
    front = clip.withers + config.front_hip * d
    rear = clip.hip + config.rear_hip * d
    s = np.stack((-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)), axis=-1)
    spread = config.hip_spread * height * np.sign(robot.p_BV[:, 1])
    p_WA = np.stack((front, front, rear, rear), axis=1) + spread[:, None] * s[:, None]
    p_WV = p_WB[:, None] + quat_rotate(base.q_WB[:, None], robot.p_BV)

    p_WF = along_tree(p_WV, p_WA, clip.toes, alpha)
    lift = config.swing_height * alpha * np.maximum(clip.toes[..., 2], 0.0)
    p_WF[..., 2] = robot.foot_radius + lift
    return replace(base, p_WF=p_WF)


def along_tree(
    p_WP: Array, p_WP_source: Array, p_WK_source: Array, scale: Array | float
) -> Array:
    """Returns where keypoints are whose parents are at ``p_WP``, (..., 3) in m.

    The vector from the source's parent to its keypoint keeps its direction. This is the
    paper's formula for one edge of a kinematic tree.
    """
    return p_WP + scale * (p_WK_source - p_WP_source)


@dataclass(frozen=True)
class Variant:
    """Changes to a recording; none by default."""

    mirror: bool = False  # whether left and right are exchanged
    froude: bool = False  # whether time is scaled for the animal's Froude number
    # Whether the trunk is moved so that the motion obeys physics, see grounding.
    ground: bool = False

    @property
    def suffix(self) -> str:
        """Suffix of a folder with such motion: "-mirrored-froude-grounded"."""
        parts = {"-mirrored": self.mirror, "-froude": self.froude}
        return "".join(k * v for k, v in parts.items()) + "-grounded" * self.ground

    def time_scale(self, scale: float) -> float:
        """Returns the duration of the motion over that of the recording.

        ``scale`` is the robot's stance height over the animal's.
        """
        return sqrt(scale) if self.froude else 1.0

    def apply(self, clip: KeypointClip, scale: float) -> KeypointClip:
        """Returns the clip in the robot's time, mirrored if requested."""
        clip = clip.mirrored() if self.mirror else clip
        return in_time(clip, self.time_scale(scale))


AS_RECORDED = Variant()


def in_time(clip: Clip, time_scale: float) -> Clip:
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
