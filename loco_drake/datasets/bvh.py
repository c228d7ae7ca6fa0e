"""The BVH form of motion capture: a skeleton, and its joint angles frame by frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from loco_drake.common.errors import InputError
from loco_drake.datasets.text import parse_numbers, read_lines

Array = NDArray[np.float64]

END_SITE = "End Site"


@dataclass(frozen=True)
class Joint:
    """A node of the skeleton.

    Attributes:
        name: :data:`END_SITE` for the end of a chain.
        parent: index of the node it hangs on, -1 for the root.
        offset: from the parent in the parent's frame, in the file's unit.
        channels: names of the numbers that move it, such as ``Zrotation``, in order.
        first: column of the first of them.
    """

    name: str
    parent: int
    offset: tuple[float, float, float]
    channels: tuple[str, ...]
    first: int


@dataclass(frozen=True)
class Bvh:
    """A recording.

    Attributes:
        joints: parents before children, in the file's order.
        motion: one row of all channels for each frame, shape (T, channels).
        fps: frames per second.
    """

    joints: list[Joint]
    motion: Array
    fps: float

    def positions(self) -> Array:
        """Returns where the joints are, by forward kinematics, shape (T, J, 3).

        Rotations of a joint apply in the order of its channels, each about the axes
        that the one before has turned; position channels replace the offset.
        """
        p = np.empty((len(self.motion), len(self.joints), 3))
        turned: list[Rotation] = []
        for index, joint in enumerate(self.joints):
            values = self.motion[:, joint.first : joint.first + len(joint.channels)]
            shift = np.tile(joint.offset, (len(values), 1))
            axes, angles = "", []
            for channel, column in zip(joint.channels, values.T, strict=True):
                if channel.endswith("position"):
                    shift[:, "XYZ".index(channel[0])] = column
                else:
                    axes += channel[0]
                    angles.append(column)
            local = Rotation.identity(len(values))
            if axes:
                local = Rotation.from_euler(axes, np.stack(angles, -1), degrees=True)
            if joint.parent < 0:
                p[:, index] = shift
                turned.append(local)
            else:
                parent = turned[joint.parent]
                p[:, index] = p[:, joint.parent] + parent.apply(shift)
                turned.append(parent * local)
        return p


def read_bvh(path: Path, what: str) -> Bvh:
    """Returns a BVH file.

    Args:
        path: the file.
        what: the format, for messages: "a BVH file of the dog".

    Raises:
        InputError: if it is no BVH file, holds fewer or more frames than it says, or
            something other than finite numbers.
    """
    lines = read_lines(path, what)
    heads = [number for number, line in enumerate(lines) if line.strip() == "MOTION"]
    if lines[0].strip() != "HIERARCHY" or len(heads) != 1 or len(lines) < heads[0] + 4:
        raise InputError(
            f"{path} is not {what}: it lacks HIERARCHY, or MOTION with its frames."
        )
    (head,) = heads
    try:
        joints = _parse_hierarchy(lines[1:head])
    except (ValueError, IndexError):
        raise InputError(f"{path} is not {what}: its HIERARCHY is damaged.") from None
    frames = _header_value(lines[head + 1], "Frames", path, what)
    step = _header_value(lines[head + 2], "Frame Time", path, what)
    columns = sum(len(joint.channels) for joint in joints)
    rows = [line.split() for line in lines[head + 3 :]]
    for number, row in enumerate(rows, start=head + 4):
        if len(row) != columns:
            raise InputError(
                f"{path} is not {what}: line {number} has {len(row)} numbers instead "
                f"of {columns}."
            )
    joined = [",".join(row) for row in rows]
    motion = parse_numbers(joined, head + 4, columns, path, what)
    if len(motion) != frames:
        raise InputError(
            f"{path} is not {what}: it holds {len(motion)} frames but says {frames:g}."
        )
    finite = np.isfinite(motion).all(axis=1)
    if not finite.all():
        line = int(np.argmin(finite)) + head + 4
        raise InputError(f"{path} is not {what}: line {line} holds NaN or infinity.")
    return Bvh(joints, motion, 1 / step)


def _header_value(line: str, name: str, path: Path, what: str) -> float:
    """Returns the number of a line such as ``Frames: 593``, above 0."""
    label, _, text = line.partition(":")
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if label.strip() != name or not 0 < value < float("inf"):
        raise InputError(f"{path} is not {what}: its MOTION lacks {name!r}.")
    return value


def _parse_hierarchy(lines: list[str]) -> list[Joint]:
    """Returns the joints; raises ValueError or IndexError if the text is damaged."""
    joints: list[Joint] = []
    open_joints: list[int] = []
    columns = 0
    words = [word for line in lines for word in line.split()]
    k = 0
    while k < len(words):
        if words[k] == "}":
            open_joints.pop()
            k += 1
            continue
        kind, name = words[k], words[k + 1]
        if kind not in ("ROOT", "JOINT", "End") or words[k + 2 : k + 4] != [
            "{",
            "OFFSET",
        ]:
            raise ValueError(kind)
        if (kind == "ROOT") != (not open_joints) or (kind == "ROOT" and joints):
            raise ValueError(kind)
        x, y, z = (float(word) for word in words[k + 4 : k + 7])
        channels: tuple[str, ...] = ()
        k += 7
        if kind != "End":
            if words[k] != "CHANNELS":
                raise ValueError(name)
            count = int(words[k + 1])
            channels = tuple(words[k + 2 : k + 2 + count])
            if len(channels) != count or not all(map(_is_channel, channels)):
                raise ValueError(name)
            k += 2 + count
        parent = open_joints[-1] if open_joints else -1
        title = END_SITE if kind == "End" else name
        joints.append(Joint(title, parent, (x, y, z), channels, columns))
        open_joints.append(len(joints) - 1)
        columns += len(channels)
    if open_joints or not joints:
        raise ValueError("braces")
    return joints


def _is_channel(name: str) -> bool:
    return name[:1] in "XYZ" and name[1:] in ("position", "rotation")
