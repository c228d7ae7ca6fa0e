"""Motion of a body on two legs as the keypoints of its tree."""

from dataclasses import dataclass, replace

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.models.legs import MIRROR_POLAR
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.keypoints import KeypointClip, mirrored_provenance

SIDES = ("left", "right")
# From the trunk outward, each the parent of the next; heel and toe both follow the
# ankle, and are at the sole.
SPINE = ("pelvis", "waist", "neck")
LEG = ("hip", "knee", "ankle", "heel", "toe")
ARM = ("shoulder", "elbow", "wrist")


@dataclass(frozen=True)
class BipedClip:
    """Spine, legs and arms over time, in metres, Z up, X forward.

    The ground is the plane z = 0 and the clip starts heading along +x. Left comes
    before right.
    """

    source: str  # name, such as human
    gait: str  # what it does, such as walk
    fps: float  # frames per second
    spine: Array  # SPINE, shape (T, 3, 3); the pelvis is midway between the hips
    legs: Array  # LEG of left and right, shape (T, 2, 5, 3)
    arms: Array  # ARM of left and right, shape (T, 2, 3, 3)
    provenance: dict[str, str]  # origin as text: file, frames, licence, ...

    def __post_init__(self) -> None:
        GaitLabel(self.source, self.gait)  # checks the names
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise InputError(f"A clip needs a rate above 0 frames/s, not {self.fps}.")
        frames = len(self.spine)
        shapes = {"spine": (3, 3), "legs": (2, 5, 3), "arms": (2, 3, 3)}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != (frames, *shape):
                raise InputError(
                    f"The {name} of a clip must have shape {(frames, *shape)}, not "
                    f"{value.shape}."
                )
            if not np.isfinite(value).all():
                raise InputError(f"The {name} of a clip hold NaN or infinity.")

    def __len__(self) -> int:
        return len(self.spine)

    @property
    def middle(self) -> Array:
        """The pelvis, shape (T, 3)."""
        return self.spine[:, 0]

    @property
    def hips(self) -> Array:
        """Left and right, shape (T, 2, 3)."""
        return self.legs[:, :, 0]

    @property
    def toes(self) -> Array:
        """What it stands on, shape (T, 4, 3): toes left and right, then heels.

        So they are where those of a body on four legs are: FL, FR, RL, RR.
        """
        heels, toes = self.legs[:, :, 3], self.legs[:, :, 4]
        return np.concatenate((toes, heels), axis=1)

    @property
    def forward(self) -> Array:
        """The horizontal direction that the pelvis faces, unit, shape (T, 3)."""
        left = self.hips[:, 0] - self.hips[:, 1]
        ahead = np.cross(left, np.array([0.0, 0.0, 1.0]))
        length = np.linalg.norm(ahead, axis=-1, keepdims=True)
        return np.asarray(ahead / np.maximum(length, 1e-9), dtype=np.float64)

    def keypoints(self) -> KeypointClip:
        """Returns it as six points, to be shown: the withers are the neck."""
        return KeypointClip(
            source=self.source,
            gait=self.gait,
            fps=self.fps,
            withers=self.spine[:, 2],
            hip=self.middle,
            toes=self.toes,
            provenance=self.provenance,
        )

    def mirrored(self) -> "BipedClip":
        """Returns the clip reflected in the plane y = 0 (left for right)."""
        return replace(
            self,
            spine=self.spine * MIRROR_POLAR,
            legs=self.legs[:, ::-1] * MIRROR_POLAR,
            arms=self.arms[:, ::-1] * MIRROR_POLAR,
            provenance=mirrored_provenance(self.provenance),
        )
