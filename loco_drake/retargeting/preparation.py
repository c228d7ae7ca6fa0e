"""What retargeting begins with, on any number of legs: clock, rate and contacts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic

from loco_drake.common.arrays import Bools
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.contacts import detect_contacts, resample_contacts
from loco_drake.retargeting.scaling import Clip, RetargetConfig, Variant, in_time


@dataclass(frozen=True)
class Prepared(Generic[Clip]):
    """A clip in the robot's time, at FPS."""

    clip: Clip
    contacts: Bools  # of its feet, shape (T, 4)
    scale: float  # the robot's stance height over the source's
    time_scale: float  # duration over that of the source


def prepare(
    clip: Clip,
    height: float,
    robot_height: float,
    config: RetargetConfig,
    variant: Variant,
    resample: Callable[[Clip, float], Clip],
    contacts: Bools | None = None,
) -> Prepared[Clip]:
    """Returns a clip, mirrored if it is to be, as its robot's formula takes it.

    Args:
        clip: the clip.
        height: of the source's stance, m.
        robot_height: of the robot's, m.
        config: with the thresholds of a contact.
        variant: with the choice of the clock.
        resample: returns the clip at another rate.
        contacts: of the clip's feet, (T, 4), if they are known; else they are detected.
    """
    scale = robot_height / height
    if contacts is None:
        contacts = detect_contacts(clip, height, config.contact)
    time_scale = variant.time_scale(scale)
    timed = in_time(clip, time_scale)
    resampled = resample(timed, FPS)
    contacts = resample_contacts(contacts, timed.fps, FPS, len(resampled))
    return Prepared(resampled, contacts, scale, time_scale)
