"""BVH motion capture files: a skeleton and its joint angles per frame."""

import re
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.files import parse_number
from loco_drake.datasets.recording import (
    LARGEST,
    parse_numbers,
    refuse_decimal_commas,
)

END_SITE = "End Site"

# A node up to those that hang on it, or the end of one.
_NODE = re.compile(
    r"(ROOT|JOINT|END) ([^{]+) { OFFSET (\S+) (\S+) (\S+)"
    r"(?: CHANNELS (\d+)((?: [XYZ](?:position|rotation))*))? |(}) ",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Joint:
    """A node of the skeleton."""

    name: str  # END_SITE for the end of a chain
    parent: int  # index of the node it hangs on, -1 for the root
    offset: tuple[float, float, float]  # in the parent's frame, in the file's unit
    channels: tuple[str, ...]  # of the numbers that move it: Zrotation, ...; in order
    first: int  # column of the first of them


@dataclass(frozen=True)
class Bvh:
    """A recording."""

    joints: list[Joint]  # parents before children, in the file's order
    motion: Array  # one row of all channels for each frame, shape (T, channels)
    fps: float  # frames per second

    def positions(self) -> Array:
        """Returns joint positions by forward kinematics, shape (T, J, 3).

        Rotations of a joint are intrinsic, in the order of its channels; position
        channels replace the offset.
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

    def find(self, chain: tuple[str, ...]) -> int:
        """Returns the last joint of a chain of names, which other joints may interrupt.

        Case and namespaces such as ``dog:`` are ignored. An end site may also be behind
        further joints.

        Raises:
            LookupError: with the first name of the chain that is not found.
        """
        found = -1
        for name in chain:
            below = (
                index
                for index, joint in enumerate(self.joints)
                if plain_name(joint.name) == plain_name(name)
                and self._is_below(index, found)
            )
            found = next(below, -1)
            if found < 0:
                raise LookupError(name)
        return found

    def _is_below(self, index: int, ancestor: int) -> bool:
        while index >= 0 and index != ancestor:
            index = self.joints[index].parent
        return index == ancestor


def parse_bvh(lines: list[str]) -> Bvh:
    """Returns what the lines of a BVH file say.

    Raises:
        InputError: if it is no BVH file, holds fewer or more frames than it says, or
            something other than finite numbers, or angles in radians.
    """
    heads = [k for k, line in enumerate(lines) if line.strip().upper() == "MOTION"]
    whole = len(heads) == 1 and len(lines) >= heads[0] + 4
    if lines[0].strip().upper() != "HIERARCHY" or not whole:
        raise InputError("it lacks HIERARCHY, or MOTION with its frames.")
    (head,) = heads
    try:
        joints = _parse_hierarchy("\n".join(lines[1:head]))
    except (ValueError, IndexError):
        raise InputError("its HIERARCHY is damaged.") from None
    refuse_decimal_commas(lines[head + 3])
    frames = _header_value(lines[head + 1], "Frames")
    step = _header_value(lines[head + 2], "Frame Time")
    columns = sum(len(joint.channels) for joint in joints)
    rows = [line.split() for line in lines[head + 3 :]]
    for number, row in enumerate(rows, start=head + 4):
        if len(row) != columns:
            raise InputError(
                f"line {number} has {len(row)} numbers instead of {columns}."
            )
    motion = parse_numbers([",".join(row) for row in rows], head + 4, columns)
    if len(motion) != frames:
        raise InputError(f"it holds {len(motion)} frames but says {frames:g}.")
    _refuse_radians(joints, motion)
    return Bvh(joints, motion, 1 / step)


def _refuse_radians(joints: list[Joint], motion: Array) -> None:
    """Raises InputError if no joint but the root ever turns by more than 2 pi.

    Legs that walk turn by tens of degrees, so such angles are in radians.
    """
    columns = [
        joint.first + k
        for joint in joints
        if joint.parent >= 0
        for k, channel in enumerate(joint.channels)
        if channel.endswith("rotation")
    ]
    largest = np.abs(motion[:, columns]).max(initial=0.0)
    if 0.3 < largest <= 2 * np.pi and len(motion) > 1:
        raise InputError(
            f"its joints turn by {largest:.3g} at most, which looks like radians; BVH "
            "has degrees."
        )


def _header_value(line: str, name: str) -> float:
    """Returns the number of a line such as ``Frames: 593``, above 0."""
    label, _, text = line.partition(":")
    refuse_decimal_commas(f"{text} {text}")
    try:
        value = parse_number(text)
    except ValueError:
        value = 0.0
    if "".join(label.lower().split()) != name.lower().replace(" ", "") or not (
        0 < value < float("inf")
    ):
        raise InputError(f"its MOTION lacks {name!r}.")
    return value


def _parse_hierarchy(text: str) -> list[Joint]:
    """Returns the joints; raises ValueError or IndexError if the text is damaged."""
    text = " ".join(text.split()) + " "
    if _NODE.sub("", text):
        raise ValueError("words")
    joints: list[Joint] = []
    open_joints: list[int] = []
    columns = 0
    for kind, name, x, y, z, count, words, end in _NODE.findall(text):
        if end:
            open_joints.pop()
            continue
        offset = float(x), float(y), float(z)
        channels = tuple(word.capitalize() for word in words.split())
        is_root, is_end = kind.upper() == "ROOT", kind.upper() == "END"
        if not (
            is_root == (not joints)
            and (is_root or open_joints)
            and is_end == (not count)
            and len(channels) == len(set(channels)) == int(count or 0)
            and all(abs(value) < LARGEST for value in offset)
        ):
            raise ValueError(name)
        parent = open_joints[-1] if open_joints else -1
        title = END_SITE if is_end else name
        joints.append(Joint(title, parent, offset, channels, columns))
        open_joints.append(len(joints) - 1)
        columns += len(channels)
    if open_joints or not joints:
        raise ValueError("braces")
    return joints


def plain_name(name: str) -> str:
    """Returns a joint's name without namespace, and without regard to case."""
    return re.split(r"[:|]", name)[-1].strip().lower()
