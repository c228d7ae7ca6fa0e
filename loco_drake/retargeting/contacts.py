"""Contact detection: which toes of a recording are on the ground."""

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.runs import intervals
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.correction import smooth
from loco_drake.retargeting.source_config import ContactConfig

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Cut-off of the trunk's speed, to which a toe's speed is compared, Hz.
_TRUNK_SPEED_HZ = 1.0


def detect_contacts(clip: KeypointClip, height: float, config: ContactConfig) -> Bools:
    """Returns which toes are on the ground, by height and speed, with hysteresis.

    A toe lands when it is low *and* slow, and leaves when it is high *or* fast; the
    thresholds for leaving are wider. Speeds are relative to the trunk's, since a dog's
    paw rolls faster in a gallop than in a walk. Short contacts and flights are removed
    as noise.

    Args:
        clip: the recording, ground at z = 0.
        height: the animal's stance height in m.
        config: the thresholds.

    Returns:
        Contacts, bool, shape (T, 4).
    """
    toe_height = clip.toes[..., 2] / height
    toe_speed = np.linalg.norm(_velocity(clip.toes, clip.fps), axis=-1)
    middle = (clip.withers + clip.hip)[:, :2] / 2
    trunk = smooth(_velocity(middle, clip.fps), _TRUNK_SPEED_HZ, clip.fps)
    trunk_speed = np.linalg.norm(trunk, axis=-1)[:, None]
    land_speed = np.maximum(config.land_speed, config.land_speed_ratio * trunk_speed)
    leave_speed = np.maximum(config.leave_speed, config.leave_speed_ratio * trunk_speed)
    lands = (toe_height < config.land_height) & (toe_speed < land_speed)
    leaves = (toe_height > config.leave_height) | (toe_speed > leave_speed)

    contacts = np.zeros(lands.shape, dtype=bool)
    for leg in range(4):
        raw = _hysteresis(lands[:, leg], leaves[:, leg])
        filled = ~_without_short(~raw, round(config.shortest_swing * clip.fps))
        shortest = round(config.shortest_stance * clip.fps)
        contacts[:, leg] = _without_short(filled, shortest)
    return contacts


def resample_contacts(
    contacts: Bools, fps: float, new_fps: float, frames: int
) -> Bools:
    """Returns contacts (frames, 4) at another rate, each that of the nearest frame."""
    nearest = np.rint(np.arange(frames) * fps / new_fps).astype(int)
    resampled: Bools = contacts[np.minimum(nearest, len(contacts) - 1)]
    return resampled


def _velocity(points: Array, fps: float) -> Array:
    velocity: Array = np.gradient(points, 1 / fps, axis=0)
    return velocity


def _hysteresis(on: Bools, off: Bools) -> Bools:
    """Returns a state that turns on with ``on`` and stays so until ``off``."""
    state = np.zeros(on.shape, dtype=bool)
    current = False
    for k in range(len(on)):
        current = (current or bool(on[k])) and not off[k]
        state[k] = current
    return state


def _without_short(flags: Bools, shortest: int) -> Bools:
    """Returns ``flags`` without runs of less than ``shortest`` frames.

    Runs that the ends of the clip cut stay: their true length is not known.
    """
    flags = flags.copy()
    for start, end in list(intervals(flags)):
        if end - start < shortest and start > 0 and end < len(flags):
            flags[start:end] = False
    return flags
