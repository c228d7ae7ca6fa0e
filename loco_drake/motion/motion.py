"""Motion of one robot at a constant rate, in memory and on disk."""

import json
import zipfile
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.common.rotations import angular_velocity, quat_continuous
from loco_drake.models.legs import (
    MIRROR_AXIAL,
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_LEGS,
    MIRROR_POLAR,
    MIRROR_QUATERNION,
)
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.keypoints import mirrored_provenance

SCHEMA_VERSION = 1
FPS = 50.0  # the rate of every Motion that this project writes, and of the policy

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

    Attributes:
        robot: name of the robot, as in :func:`loco_drake.models.robots.get_robot`.
        source: where the motion comes from, see
            :data:`loco_drake.motion.gaits.SOURCES`.
        gait: name of the gait.
        fps: frames per second.
        joint_names: names of the J joints.
        base_position: p_WB in m, shape (T, 3).
        base_quaternion: R_WB as unit quaternions w, x, y, z, shape (T, 4).
        joint_positions: rad, shape (T, J).
        base_velocity: v_WB_W in m/s, shape (T, 3).
        base_angular_velocity: w_WB_W in rad/s, shape (T, 3).
        joint_velocities: rad/s, shape (T, J).
        contacts: whether each foot is on the ground, bool, shape (T, 4).
        provenance: where the motion comes from, as text.
    """

    robot: str
    source: str
    gait: str
    fps: float
    joint_names: tuple[str, ...]
    base_position: NDArray[np.float64]
    base_quaternion: NDArray[np.float64]
    joint_positions: NDArray[np.float64]
    base_velocity: NDArray[np.float64]
    base_angular_velocity: NDArray[np.float64]
    joint_velocities: NDArray[np.float64]
    contacts: NDArray[np.bool_]
    provenance: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check(self)

    def __len__(self) -> int:
        return len(self.base_position)

    @property
    def label(self) -> GaitLabel:
        """The (source, gait) pair."""
        return GaitLabel(self.source, self.gait)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.fps

    def slice(self, start: int, end: int) -> "Motion":
        """Returns frames ``start`` to ``end`` (exclusive)."""
        return replace(self, **{name: getattr(self, name)[start:end] for name in UNITS})

    def mirrored(self) -> "Motion":
        """Returns the motion reflected in the plane y = 0 (left for right).

        Raises:
            InputError: unless the robot has three joints a leg, like Go2 and A1.
        """
        if len(self.joint_names) != len(MIRROR_JOINTS):
            raise InputError(
                f"Only motion of {len(MIRROR_JOINTS)} joints, as of go2 and a1, can be "
                f"mirrored, not {len(self.joint_names)}; mirror it when retargeting."
            )

        def joints(values: NDArray[np.float64]) -> NDArray[np.float64]:
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
    base_position: NDArray[np.float64],
    base_quaternion: NDArray[np.float64],
    joint_positions: NDArray[np.float64],
    contacts: NDArray[np.bool_],
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


def save_motion(motion: Motion, path: Path) -> None:
    """Writes ``motion`` to a ``.npz`` that describes itself, wholly or not at all."""
    header = {
        "schema_version": SCHEMA_VERSION,
        "robot": motion.robot,
        "source": motion.source,
        "gait": motion.gait,
        "fps": motion.fps,
        "joint_names": list(motion.joint_names),
        "units": UNITS,
        "provenance": motion.provenance,
    }
    path = Path(path)
    if path.suffix != ".npz":
        raise InputError(f"A Motion file must be named *.npz, not {path.name!r}.")
    with atomic_path(path) as temporary:
        arrays = {name: getattr(motion, name) for name in UNITS}
        np.savez_compressed(temporary, header=json.dumps(header), **arrays)


def load_motion(path: Path) -> Motion:
    """Reads a Motion file.

    Raises:
        InputError: if the file is missing, damaged, of a newer schema, or fails a
            check of :class:`Motion`.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"There is no Motion file {str(path)!r}.")
    try:
        # numpy leaves a file open that it cannot read.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        header = json.loads(str(arrays.pop("header")))
        version = int(header["schema_version"])
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
        raise InputError(
            f"{path} is not a Motion file: it must be an .npz with a JSON header."
        ) from None
    if version > SCHEMA_VERSION:
        raise InputError(
            f"{path} has Motion schema {version}; "
            f"this version reads up to {SCHEMA_VERSION}."
        )
    required = ("robot", "source", "gait", "fps", "joint_names")
    missing = [name for name in required if name not in header]
    missing += [name for name in UNITS if name not in arrays]
    if missing:
        raise InputError(f"{path} lacks {', '.join(missing)}.")
    try:
        return Motion(
            robot=str(header["robot"]),
            source=str(header["source"]),
            gait=str(header["gait"]),
            fps=float(header["fps"]),
            joint_names=tuple(str(name) for name in header["joint_names"]),
            provenance={k: str(v) for k, v in header.get("provenance", {}).items()},
            **{name: arrays[name] for name in UNITS},
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (TypeError, ValueError, AttributeError):
        raise InputError(f"{path} has a damaged Motion header.") from None


def _check(motion: Motion) -> None:
    """Raises InputError, in one sentence, unless ``motion`` is sound."""
    if not (np.isfinite(motion.fps) and motion.fps > 0):
        raise InputError(f"A motion needs a rate above 0 frames/s, not {motion.fps}.")
    frames = len(motion.base_position)
    joints = len(motion.joint_names)
    if frames < 1:
        raise InputError("A motion needs at least one frame.")
    widths = {
        "base_position": 3,
        "base_quaternion": 4,
        "joint_positions": joints,
        "base_velocity": 3,
        "base_angular_velocity": 3,
        "joint_velocities": joints,
        "contacts": 4,
    }
    for name, width in widths.items():
        value = getattr(motion, name)
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
    norms = np.sqrt((motion.base_quaternion**2).sum(axis=1))
    if np.abs(norms - 1).max() > 1e-3:
        raise InputError("The base_quaternion of a motion must be unit quaternions.")
