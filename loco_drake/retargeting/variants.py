"""Variants of a recording: its mirror image, and the same gait in a robot's own time.

By default a robot keeps the animal's timing, as in the paper, so that a small robot
moves like a large animal in slow motion. Two bodies, small and large, move alike
dynamically if their Froude numbers v^2 / (g h) are equal (Alexander and Jayes 1983, "A
dynamic similarity hypothesis for the gaits of quadrupedal mammals"): with lengths alpha
times those of the animal, times are sqrt(alpha) times its own, and so are speeds.

Noise and the thresholds of a contact are the recording's and so belong to the animal's
clock: contacts are found before the clock is changed, and cut-off frequencies change
with it. The clearance of a swing and the limits of the joints are the robot's.
"""

from dataclasses import dataclass, replace
from math import sqrt

from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.source_config import RetargetConfig


@dataclass(frozen=True)
class Variant:
    """What is to be changed of a recording; by default nothing.

    Attributes:
        mirror: whether left and right are exchanged.
        froude: whether time is scaled for the animal's Froude number.
    """

    mirror: bool = False
    froude: bool = False

    @property
    def suffix(self) -> str:
        """What tells a folder of such motion from others: "-mirrored-froude"."""
        return "-mirrored" * self.mirror + "-froude" * self.froude

    def time_scale(self, scale: float) -> float:
        """Returns how long the motion lasts, over the recording.

        Args:
            scale: the robot's stance height over the animal's.
        """
        return sqrt(scale) if self.froude else 1.0

    def apply(self, clip: KeypointClip, scale: float) -> KeypointClip:
        """Returns the clip in the robot's time, mirrored where that is asked for."""
        clip = clip.mirrored() if self.mirror else clip
        return in_time(clip, self.time_scale(scale))


AS_RECORDED = Variant()


def in_time(clip: KeypointClip, time_scale: float) -> KeypointClip:
    """Returns the clip with a clock on which it lasts ``time_scale`` times as long."""
    return replace(
        clip,
        fps=clip.fps / time_scale,
        provenance={**clip.provenance, "time_scale": f"{time_scale:.6g}"},
    )


def smoothing_in_time(config: RetargetConfig, time_scale: float) -> RetargetConfig:
    """Returns the configuration with the cut-offs of that clock, in Hz."""
    smoothing = replace(
        config.smoothing,
        base=config.smoothing.base / time_scale,
        toes=config.smoothing.toes / time_scale,
    )
    return replace(config, smoothing=smoothing)
