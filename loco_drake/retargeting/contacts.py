"""Measures of the animal: when it stands, how high, and on which toes."""

from typing import Protocol

import numpy as np
from scipy.ndimage import binary_opening

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.errors import InputError
from loco_drake.common.runs import intervals
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.correction import smooth
from loco_drake.retargeting.scaling import ContactConfig, RetargetConfig

# Cut-off of the trunk's speed, to which a toe's speed is compared, Hz.
_TRUNK_SPEED_HZ = 1.0

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


def on_feet(clip: KeypointClip) -> Bools:
    """Returns in which frames the animal stands on its feet, shape (T,).

    In these, withers and hip are about as high as they are far from their toes, the
    legs are not folded, and the trunk is neither on the ground nor steep. A sitting
    animal has a low hip; a lying one has its legs folded or to the side.
    """
    front = np.linalg.norm(clip.toes[:, :2] - clip.withers[:, None], axis=-1).mean(1)
    rear = np.linalg.norm(clip.toes[:, 2:] - clip.hip[:, None], axis=-1).mean(1)
    trunk = np.median(np.linalg.norm(clip.withers - clip.hip, axis=-1))
    upright = (
        (clip.withers[:, 2] > UPRIGHT * front)
        & (clip.hip[:, 2] > UPRIGHT * rear)
        & (clip.middle[:, 2] > OFF_THE_GROUND * trunk)
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


def frames_on_feet(clip: KeypointClip, standing: Bools) -> str:
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
    middle = clip.middle[:, 2]
    lowest = float(np.percentile(middle, config.stance_height_percentile))
    if lowest <= 0:
        raise InputError(
            f"The middle of withers and hip lies {lowest:.3g} m over the ground, "
            "so the animal does not stand on its feet."
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


class Standing(Protocol):
    """What stands on toes: a body on any legs."""

    @property
    def fps(self) -> float:
        """Frames per second."""

    @property
    def toes(self) -> Array:
        """Points that touch the ground in m, shape (T, N, 3)."""

    @property
    def middle(self) -> Array:
        """Of the trunk in m, shape (T, 3)."""


def detect_contacts(clip: Standing, height: float, config: ContactConfig) -> Bools:
    """Returns which toes (T, 4) are on the ground, by height and speed.

    A toe lands when it is low *and* slow, and leaves when it is high *or* fast; the
    thresholds for leaving are wider. Heights are relative to the animal's stance
    height in m, speeds to the trunk's, since a dog's paw rolls faster in a gallop than
    in a walk. Short contacts and flights are removed as noise.
    """
    toe_height = clip.toes[..., 2] / height
    toe_speed = np.linalg.norm(np.gradient(clip.toes, 1 / clip.fps, axis=0), axis=-1)
    velocity = np.gradient(clip.middle[:, :2], 1 / clip.fps, axis=0)
    trunk = smooth(velocity, _TRUNK_SPEED_HZ, clip.fps)
    trunk_speed = np.linalg.norm(trunk, axis=-1)[:, None]
    land_speed = np.maximum(config.land_speed, config.land_speed_ratio * trunk_speed)
    leave_speed = np.maximum(config.leave_speed, config.leave_speed_ratio * trunk_speed)
    lands = (toe_height < config.land_height) & (toe_speed < land_speed)
    leaves = (toe_height > config.leave_height) | (toe_speed > leave_speed)
    # The last event decides; before the first one the toe is in the air.
    frames = np.arange(1, len(lands) + 1)[:, None]
    last = np.maximum.accumulate(np.where(lands | leaves, frames, 0))
    down = np.take_along_axis(np.pad(lands & ~leaves, ((1, 0), (0, 0))), last, axis=0)
    filled = ~_without_short(~down, round(config.shortest_swing * clip.fps))
    return _without_short(filled, round(config.shortest_stance * clip.fps))


def resample_contacts(
    contacts: Bools, fps: float, new_fps: float, frames: int
) -> Bools:
    """Returns contacts (frames, 4) at another rate, each that of the nearest frame."""
    nearest = np.rint(np.arange(frames) * fps / new_fps).astype(int)
    resampled: Bools = contacts[np.minimum(nearest, len(contacts) - 1)]
    return resampled


def _without_short(flags: Bools, shortest: int) -> Bools:
    """Returns flags (T, N) without runs of less than ``shortest`` frames.

    Runs that the ends of the clip cut stay: their true length is not known.
    """
    size = max(shortest, 1)
    padded = np.pad(flags, ((size, size), (0, 0)), constant_values=True)
    kept: Bools = binary_opening(padded, np.ones((size, 1)))[size:-size]
    return kept
