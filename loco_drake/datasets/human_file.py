"""Files of human motion in the format of DeepMimic (Peng et al. 2018).

A clip is a JSON file of frames: a duration, the root's position and rotation, and the
rotations of joints, each relative to its parent's: a quaternion w, x, y, z, or an angle
about z at knees and elbows. Bones, and the boxes of the feet, are in a URDF of four
times the size, ``humanoid.urdf``, which lies beside the clips or where pybullet's
package has it.
"""

import json
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.datasets.recording import MIN_FRAMES

SKELETON = "humanoid.urdf"
# Joints in a frame, from its ninth number on; 1 is an angle, 4 a quaternion.
_ORDER = [("chest", 4), ("neck", 4)]
for _side in ("right", "left"):
    _ORDER += [(f"{_side}_hip", 4), (f"{_side}_knee", 1), (f"{_side}_ankle", 4)]
    _ORDER += [(f"{_side}_shoulder", 4), (f"{_side}_elbow", 1)]
_WIDTH = 8 + sum(width for _, width in _ORDER)
_MAX_BYTES = 50_000_000
# Quaternions that were interpolated without care are as short as .58.
_LEAST_NORM = 0.5


class Skeleton(NamedTuple):
    """Bones of a person, where all joints are at zero, in units of its URDF."""

    parents: dict[str, str]  # of joints; "root" has none
    offsets: dict[str, Array]  # of joints from their parents, shape (3,)
    soles: Array  # heel and toe in the frames of the ankles, shape (2, 3)


@dataclass(frozen=True)
class Capture:
    """The content of a clip's file."""

    time: Array  # of each frame, s, shape (T,)
    root: Array  # position, m, shape (T, 3)
    rotations: dict[str, Array]  # unit quaternions w, x, y, z by joint, shape (T, 4)
    loop: bool  # whether the file says that it can be repeated
    frames: int = 0  # in the file
    notes: dict[str, str] = field(default_factory=dict)  # for the clip's provenance


def read_capture(path: Path) -> Capture:
    """Returns what a clip's file holds.

    Raises:
        InputError: naming what is missing or damaged.
    """
    text = _content(path)
    try:
        content = json.loads(text)
        frames = np.array(content["Frames"], dtype=np.float64)
        loop = content.get("Loop", "none") == "wrap"
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(
            "it must be JSON with Frames, each a list of as many numbers."
        ) from None
    if frames.ndim != 2 or frames.shape[1] != _WIDTH:
        raise InputError(f"its frames must have {_WIDTH} numbers each.")
    if len(frames) < MIN_FRAMES:
        raise InputError(f"it needs at least {MIN_FRAMES} frames, not {len(frames)}.")
    if not np.isfinite(frames).all():
        raise InputError("it holds NaN or infinity.")
    # The last frame's duration is nobody's.
    steps = frames[:-1, 0]
    if steps.min() <= 0:
        raise InputError(f"frame {int(steps.argmin())} has no duration.")
    rotations, at = {"root": _unit(frames[:, 4:8])}, 8
    for name, width in _ORDER:
        values = frames[:, at : at + width]
        rotations[name] = _unit(values) if width == 4 else _about_z(values[:, 0])
        at += width
    time = np.concatenate(([0.0], np.cumsum(steps)))
    return Capture(time, frames[:, 1:4], rotations, loop, len(frames))


def find_skeleton(path: Path) -> Path:
    """Returns the path of a clip's skeleton.

    Raises:
        InputError: if there is none.
    """
    places = [path.parent / SKELETON, path.parents[2] / "humanoid" / SKELETON]
    for place in places if len(path.parents) > 2 else places[:1]:
        if place.is_file():
            return place
    raise InputError(f"its skeleton {SKELETON} is not in the folder {path.parent}.")


def read_skeleton(path: Path) -> Skeleton:
    """Returns the bones in a URDF.

    Raises:
        InputError: if it is damaged, or no body of this form.
    """
    # Pybullet's ends in a zero byte.
    text = _content(path).rstrip("\0 \r\n")
    try:
        root = ET.fromstring(text)
        joints = {str(joint.get("name")): joint for joint in root.iterfind("joint")}
        parents, offsets = {}, {}
        for name in (*(name for name, _ in _ORDER), "left_wrist", "right_wrist"):
            parents[name] = joints[name].find("parent").attrib["link"]  # type: ignore[union-attr]
            offsets[name] = _origin(joints[name])
        (box,) = {
            (tuple(_origin(link)), tuple(_vector(link.find(".//box"), "size")))
            for link in root.iterfind("link/collision/..")
            if str(link.get("name")).endswith("_ankle")
            for link in link.iterfind("collision")
        }
    except (ET.ParseError, KeyError, ValueError, AttributeError):
        raise InputError(
            f"{path} is not the URDF of a person as pybullet has it."
        ) from None
    centre, size = np.array(box)
    ends = np.array([[-size[0] / 2, -size[1] / 2, 0], [size[0] / 2, -size[1] / 2, 0]])
    return Skeleton(parents, offsets, centre + ends)


def _content(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    if len(content) > _MAX_BYTES:
        raise InputError(f"{path} is larger than {_MAX_BYTES // 10**6} MB.")
    return content.decode("utf-8", errors="replace")


def _unit(q: Array) -> Array:
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if norm.min() < _LEAST_NORM or norm.max() > 1 / _LEAST_NORM:
        raise InputError("its rotations must be unit quaternions.")
    return np.asarray(q / norm, dtype=np.float64)


def _about_z(angle: Array) -> Array:
    zero = np.zeros_like(angle)
    return np.stack((np.cos(angle / 2), zero, zero, np.sin(angle / 2)), axis=-1)


def _origin(element: ET.Element) -> Array:
    origin = element.find("origin")
    if origin is None or np.abs(_vector(origin, "rpy")).max() > 0:
        raise ValueError("a turned frame")
    return _vector(origin, "xyz")


def _vector(element: ET.Element | None, key: str) -> Array:
    if element is None:
        raise ValueError(key)
    return np.array([float(text) for text in element.attrib[key].split()])
