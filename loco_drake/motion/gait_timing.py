"""Gait timing from the geometry of trunk and toes.

The same definitions hold for an animal's keypoints and for a robot's kinematics, and do
not depend on scale. x is the fore-aft position of a toe relative to the trunk, along
the trunk's heading.

- Stride period: the lag T of the first high peak of the correlation between the four
  x(t) and the four x(t + T), up to half of the clip, refined by a parabola through the
  peak and its neighbours. It is undefined for a clip shorter than three strides, or
  fewer if so requested.
- Phase lag: the lag of a toe's cycle behind that of RL as a share of the stride, 0 to
  1. It is the difference between the phases of the fundamentals of x(t), fitted by
  least squares together with two harmonics and a straight line.
- Duty factor: the share of whole strides in which a toe is down. It is down between two
  frames if its sole is lower than 6 % of the stance height in both and its speed over
  the ground is below half of the trunk's mean speed, or below half a stance height per
  second if that is more. A toe that hovers or moves along with the trunk is never down.
"""

from dataclasses import dataclass

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import yaw_of
from loco_drake.models.legs import LEGS
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import Motion
from loco_drake.motion.quality import toe_trajectories

_REFERENCE_LEG = LEGS.index("RL")
MIN_STRIDES = 3

# A peak is high from this share of the highest; noise can raise the peak at two strides
# above the first. A clip without a peak above the second value has no rhythm.
_HIGH_PEAK = 0.85
_LOWEST_PEAK = 0.5
_HARMONICS = 3
_DOWN_HEIGHT = 0.06  # stance heights
_DOWN_SPEED_RATIO = 0.5
_DOWN_SPEED = 0.5  # stance heights per second


@dataclass(frozen=True)
class Track:
    """Trunk and soles of an animal or robot over time."""

    fps: float  # frames per second
    trunk: Array  # horizontal position of the trunk's middle in m, shape (T, 2)
    yaw: Array  # heading of the trunk in rad, shape (T,)
    soles: Array  # lowest points of the toes in m, ground at z = 0, shape (T, 4, 3)
    stance_height: float  # of the animal or robot in m, the unit of length

    @property
    def fore_aft(self) -> Array:
        """Position of each toe ahead of the trunk, along its heading, m, (T, 4)."""
        offset = self.soles[..., :2] - self.trunk[:, None]
        ahead = np.stack((np.cos(self.yaw), np.sin(self.yaw)), axis=-1)
        return np.einsum("tlk,tk->tl", offset, ahead)


@dataclass(frozen=True)
class GaitTiming:
    """Gait timing of a clip; see the definitions above."""

    stride_period: float  # s
    phase_lags: Array  # behind RL, as shares of the stride within [0, 1), shape (4,)
    duty_factors: Array  # shape (4,)


def clip_track(clip: KeypointClip, stance_height: float) -> Track:
    """Returns the track of an animal; its trunk is midway between withers and hip."""
    spine = clip.withers - clip.hip
    return Track(
        fps=clip.fps,
        trunk=clip.middle[:, :2],
        yaw=np.arctan2(spine[:, 1], spine[:, 0]),
        soles=clip.toes,
        stance_height=stance_height,
    )


def motion_track(motion: Motion, robot: Quadruped) -> Track:
    """Returns the track of a robot's motion."""
    return Track(
        fps=motion.fps,
        trunk=motion.base_position[:, :2],
        yaw=yaw_of(motion.base_quaternion),
        soles=toe_trajectories(motion, robot) - [0.0, 0.0, robot.foot_radius],
        stance_height=robot.stand_height,
    )


def gait_timing(track: Track, strides: int = MIN_STRIDES) -> GaitTiming | None:
    """Returns the gait timing of a track; None if it has fewer than ``strides``."""
    period = stride_period(track, strides)
    if period is None:
        return None
    return GaitTiming(period, phase_lags(track, period), duty_factors(track, period))


def stride_period(track: Track, strides: int = MIN_STRIDES) -> float | None:
    """Returns the stride period in s; None if there are fewer than ``strides``."""
    signals = track.fore_aft
    lags = (len(signals) - 1) // 2
    correlation = np.array([_correlation(signals, lag) for lag in range(lags + 2)])
    inner = correlation[1:-1]
    peaks = 1 + np.flatnonzero((inner > correlation[:-2]) & (inner >= correlation[2:]))
    if not len(peaks) or correlation[peaks].max() < _LOWEST_PEAK:
        return None
    high = correlation[peaks] >= _HIGH_PEAK * correlation[peaks].max()
    peak = int(peaks[high][0])
    before, top, after = correlation[peak - 1 : peak + 2]
    period = float(peak + (before - after) / (2 * (before - 2 * top + after)))
    # Tolerance for a clip of exactly this many strides.
    enough = len(signals) - 1 >= strides * period - 0.5
    return period / track.fps if enough else None


def phase_lags(track: Track, period: float) -> Array:
    """Returns the phase lag of each toe behind RL, shape (4,)."""
    time = np.arange(len(track.soles)) / track.fps
    angles = 2 * np.pi * np.outer(time / period, np.arange(1, _HARMONICS + 1))
    line = np.stack((np.ones_like(time), time / time[-1]), axis=-1)
    basis = np.concatenate((np.cos(angles), np.sin(angles), line), axis=-1)
    fit, *_ = np.linalg.lstsq(basis, track.fore_aft)
    phase = np.arctan2(fit[_HARMONICS], fit[0]) / (2 * np.pi)
    return (phase - phase[_REFERENCE_LEG]) % 1.0


def duty_factors(track: Track, period: float) -> Array:
    """Returns the duty factor of each toe over whole strides, shape (4,)."""
    speed = _speed(track.soles[..., :2], track.fps)
    trunk_speed = float(_speed(track.trunk, track.fps).mean())
    slow = speed < max(
        _DOWN_SPEED_RATIO * trunk_speed, _DOWN_SPEED * track.stance_height
    )
    low = track.soles[..., 2] < _DOWN_HEIGHT * track.stance_height
    down = low[:-1] & low[1:] & slow
    strides = int(len(down) / track.fps / period)
    return down[: round(strides * period * track.fps)].mean(axis=0)


def _speed(points: Array, fps: float) -> Array:
    """Returns the speeds between frames, (T - 1, ...), of points (T, ..., 2)."""
    steps = np.diff(points, axis=0) * fps
    return np.hypot(steps[..., 0], steps[..., 1])


def _correlation(signals: Array, lag: int) -> float:
    """Returns the correlation of (T, N) with itself ``lag`` frames later, all N pooled.

    Means are those of the frames that overlap, so that it is 1 for a periodic signal.
    """
    a, b = signals[: len(signals) - lag], signals[lag:]
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    norm = float(np.sqrt((a * a).sum() * (b * b).sum()))
    return float((a * b).sum()) / norm if norm > 0 else 0.0
