"""Motion of one robot at a constant rate."""

from dataclasses import dataclass, field, replace

import numpy as np

from loco_drake.common.arrays import Array, Bools, Integers
from loco_drake.common.errors import InputError, check_name
from loco_drake.common.rotations import angular_velocity, quat_continuous
from loco_drake.models.legs import (
    MIRROR_AXIAL,
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_LEGS,
    MIRROR_POLAR,
    MIRROR_QUATERNION,
)
from loco_drake.motion.gaits import GaitLabel, GaitSchedule
from loco_drake.motion.keypoints import mirrored_provenance

FPS = 50.0  # rate of every Motion written by this project, and of the policy

UNITS = {
    "base_position": "m, p_WB",
    "base_quaternion": "unit, w x y z, R_WB",
    "joint_positions": "rad",
    "base_velocity": "m/s, v_WB_W",
    "base_angular_velocity": "rad/s, w_WB_W",
    "joint_velocities": "rad/s",
    "contacts": "foot on the ground, FL FR RL RR",
}


@dataclass(frozen=True)
class Motion:
    """Base, joints and contacts of one robot over T frames at a constant rate.

    W is the world: z up, ground at z = 0. B is the robot's trunk frame. Arrays of
    joints follow ``joint_names``, legs FL, FR, RL, RR.
    """

    robot: str  # name, as in loco_drake.models.robots.get_robot
    source: str  # origin, such as dog
    gait: str
    fps: float  # frames per second
    joint_names: tuple[str, ...]  # of the J joints
    base_position: Array  # p_WB in m, shape (T, 3)
    base_quaternion: Array  # R_WB as unit w x y z, shape (T, 4)
    joint_positions: Array  # rad, shape (T, J)
    base_velocity: Array  # v_WB_W in m/s, shape (T, 3)
    base_angular_velocity: Array  # w_WB_W in rad/s, shape (T, 3)
    joint_velocities: Array  # rad/s, shape (T, J)
    contacts: Bools  # whether each foot is on the ground, shape (T, 4)
    provenance: dict[str, str] = field(default_factory=dict)  # origin as text
    # First frame, from 0, and label of each gait; empty if there is only one.
    gait_changes: tuple[tuple[int, GaitLabel], ...] = ()

    def __post_init__(self) -> None:
        check_name("robot", self.robot)
        GaitLabel(self.source, self.gait)  # checks the names
        starts = [start for start, _ in self.gait_changes]
        if starts and (starts[0] != 0 or sorted(set(starts)) != starts):
            raise InputError(
                "The gaits of a motion must start at ascending frames from 0."
            )
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise InputError(f"A motion needs a rate above 0 frames/s, not {self.fps}.")
        frames, joints = len(self.base_position), len(self.joint_names)
        if frames < 1:
            raise InputError("A motion needs at least one frame.")
        for name, width in zip(UNITS, (3, 4, joints, 3, 3, joints, 4), strict=True):
            value = getattr(self, name)
            if value.shape != (frames, width):
                raise InputError(
                    f"The {name} of this motion must have shape {(frames, width)}, "
                    f"not {value.shape}."
                )
            kind = "b" if name == "contacts" else "f"
            if value.dtype.kind != kind:
                raise InputError(
                    f"The {name} of a motion must be "
                    f"{'bool' if kind == 'b' else 'floating point'}, not {value.dtype}."
                )
            if not np.isfinite(value).all():
                raise InputError(f"The {name} of this motion hold NaN or infinity.")
        if np.abs(np.linalg.norm(self.base_quaternion, axis=1) - 1).max() > 1e-3:
            raise InputError(
                "The base_quaternion of a motion must be unit quaternions."
            )

    def __len__(self) -> int:
        return len(self.base_position)

    @property
    def label(self) -> GaitLabel:
        """The (source, gait) pair."""
        return GaitLabel(self.source, self.gait)

    @property
    def grounded(self) -> bool:
        """Whether it was made to obey physics, see loco_drake.retargeting.grounding."""
        return "momentum_error" in self.provenance

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.fps

    @property
    def label_indices(self) -> Integers:
        """Row of :data:`loco_drake.motion.gaits.ONE_HOT` of each frame, shape (T,)."""
        changes = self.gait_changes or ((0, self.label),)
        starts, labels = zip(*changes, strict=True)
        return GaitSchedule(labels, starts).at(np.arange(len(self)))

    def slice(self, start: int, end: int) -> "Motion":
        """Returns frames ``start`` to ``end`` (exclusive)."""
        arrays = {name: getattr(self, name)[start:end] for name in UNITS}
        begun = [change for change in self.gait_changes if change[0] <= start]
        later = [change for change in self.gait_changes if start < change[0] < end]
        changes = tuple((max(k - start, 0), label) for k, label in begun[-1:] + later)
        return replace(self, **arrays, gait_changes=changes)

    def mirrored(self) -> "Motion":
        """Returns the motion reflected in the plane y = 0 (left for right).

        Raises:
            InputError: unless the robot has three joints per leg, as Go2 and A1.
        """
        if len(self.joint_names) != len(MIRROR_JOINTS):
            raise InputError(
                f"Only motion of {len(MIRROR_JOINTS)} joints, as of go2 and a1, can be "
                f"mirrored, not {len(self.joint_names)}; mirror it when retargeting."
            )

        def joints(values: Array) -> Array:
            return values[:, MIRROR_JOINTS] * MIRROR_JOINT_SIGNS

        return replace(
            self,
            base_position=self.base_position * MIRROR_POLAR,
            base_quaternion=self.base_quaternion * MIRROR_QUATERNION,
            joint_positions=joints(self.joint_positions),
            base_velocity=self.base_velocity * MIRROR_POLAR,
            base_angular_velocity=self.base_angular_velocity * MIRROR_AXIAL,
            joint_velocities=joints(self.joint_velocities),
            contacts=self.contacts[:, MIRROR_LEGS],
            provenance=mirrored_provenance(self.provenance),
        )


def make_motion(
    *,
    robot: str,
    label: GaitLabel,
    joint_names: tuple[str, ...],
    base_position: Array,
    base_quaternion: Array,
    joint_positions: Array,
    contacts: Bools,
    provenance: dict[str, str],
    fps: float = FPS,
) -> Motion:
    """Returns a Motion whose velocities are central differences of its positions."""
    if len(base_position) < 3:
        raise InputError(f"A motion needs at least 3 frames, not {len(base_position)}.")
    quaternion = quat_continuous(base_quaternion)
    return Motion(
        robot=robot,
        source=label.source,
        gait=label.gait,
        fps=fps,
        joint_names=joint_names,
        base_position=base_position,
        base_quaternion=quaternion,
        joint_positions=joint_positions,
        base_velocity=np.gradient(base_position, 1 / fps, axis=0),
        base_angular_velocity=angular_velocity(quaternion, 1 / fps),
        joint_velocities=np.gradient(joint_positions, 1 / fps, axis=0),
        contacts=contacts,
        provenance=provenance,
    )
