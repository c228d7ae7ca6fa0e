"""Motion of any four-legged source as six keypoints."""

from dataclasses import dataclass, replace

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.models.legs import MIRROR_LEGS, MIRROR_POLAR
from loco_drake.motion.gaits import GaitLabel


@dataclass(frozen=True)
class KeypointClip:
    """Withers, hip and four toes over time, in metres, Z up, X forward.

    The ground is the plane z = 0 and the clip starts heading along +x. This is the only
    input of :mod:`loco_drake.retargeting`.
    """

    source: str  # name of the animal or robot, such as dog; need not be a known one
    gait: str  # need not be one of the fifteen labels
    fps: float  # frames per second, the source's own rate
    withers: Array  # shape (T, 3)
    hip: Array  # top of the pelvis, shape (T, 3)
    toes: Array  # legs FL, FR, RL, RR, shape (T, 4, 3)
    provenance: dict[str, str]  # origin as text: file, frames, licence, ...

    def __post_init__(self) -> None:
        GaitLabel(self.source, self.gait)  # checks the names
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise InputError(
                f"A keypoint clip needs a rate above 0 frames/s, not {self.fps}."
            )
        frames = len(self.withers)
        shapes = {"withers": (frames, 3), "hip": (frames, 3), "toes": (frames, 4, 3)}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise InputError(
                    f"The {name} of a keypoint clip must have shape {shape}, "
                    f"not {value.shape}."
                )
            if not np.isfinite(value).all():
                raise InputError(f"The {name} of a keypoint clip hold NaN or infinity.")

    def __len__(self) -> int:
        return len(self.withers)

    @property
    def middle(self) -> Array:
        """Midway between withers and hip, shape (T, 3)."""
        return (self.withers + self.hip) / 2

    def mirrored(self) -> "KeypointClip":
        """Returns the clip reflected in the plane y = 0 (left for right)."""
        return replace(
            self,
            withers=self.withers * MIRROR_POLAR,
            hip=self.hip * MIRROR_POLAR,
            toes=self.toes[:, MIRROR_LEGS] * MIRROR_POLAR,
            provenance=mirrored_provenance(self.provenance),
        )


def mirrored_provenance(provenance: dict[str, str]) -> dict[str, str]:
    """Returns the provenance of the mirror image; a mirror's mirror is the original."""
    if "mirrored" in provenance:
        return {key: text for key, text in provenance.items() if key != "mirrored"}
    return {**provenance, "mirrored": "left-right"}
