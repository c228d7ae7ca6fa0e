"""Human motion in the format of DeepMimic (Peng et al. 2018), as pybullet ships it.

A clip is a JSON file of frames: a duration, the root's position and rotation, and the
rotations of joints, each relative to its parent's: a quaternion w, x, y, z, or an angle
about z at knees and elbows. Bones, and the boxes of the feet, are in a URDF of four
times the size, ``humanoid.urdf``, which lies beside the clips or where pybullet's
package has it. There y points up, x forward and z to the right.
"""

import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_multiply, quat_rotate
from loco_drake.datasets.human_conventions import check_reading, settle
from loco_drake.datasets.recording import MIN_FRAMES, check_rate
from loco_drake.motion.biped_clip import ARM, LEG, SIDES, SPINE, BipedClip

SOURCE, FOLDER = "human", "human_pybullet"
LICENCE = "zlib (of pybullet; the origin of the capture is not stated)"
ATTRIBUTION = "Coumans and Bai (pybullet 3.2.7), in the format of Peng et al. 2018"
SKELETON = "humanoid.urdf"
PREFIX = "humanoid3d_"  # of clips' names
UNIT = 0.25  # m in a unit of the URDF
CLOSED = 0.3  # m; what begins as it ends is off by less
# Quaternions that were interpolated without care are as short as .58.
_LEAST_NORM = 0.5

# Joints in a frame, from its ninth number on; 1 is an angle, 4 a quaternion.
_ORDER = [("chest", 4), ("neck", 4)]
for _side in ("right", "left"):
    _ORDER += [(f"{_side}_hip", 4), (f"{_side}_knee", 1), (f"{_side}_ankle", 4)]
    _ORDER += [(f"{_side}_shoulder", 4), (f"{_side}_elbow", 1)]
_WIDTH = 8 + sum(width for _, width in _ORDER)
_MAX_BYTES = 50_000_000


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


def read_human(path: Path, gait: str | None = None, cycles: int = 1) -> BipedClip:
    """Returns a clip, its conventions measured; see :mod:`.human_conventions`.

    Args:
        path: the clip; its skeleton is found beside it.
        gait: what it shows; by default its file's name tells.
        cycles: how often it is played, each time from where it ended, which only makes
            sense of what begins as it ends.

    Raises:
        InputError: if a file is missing or damaged, or contradicts its format.
    """
    path = Path(path)
    try:
        capture = read_capture(path)
        skeleton = read_skeleton(find_skeleton(path))
        points = pose(skeleton, capture)
        check_reading(capture, points, lambda other: pose(skeleton, other))
        clip = _clip(path, gait, capture, points)
        clip = settle(clip)
        return repeated(clip, capture.loop, cycles)
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path} cannot be read as human motion: {error}") from None


def read_capture(path: Path) -> Capture:
    """Returns what a clip's file holds.

    Raises:
        InputError: naming what is missing or damaged.
    """
    try:
        content = json.loads(_content(path))
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
    return Capture(time, frames[:, 1:4], rotations, loop)


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
    try:
        # Pybullet's ends in a zero byte.
        root = ET.fromstring(_content(path).rstrip("\0 \n"))
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
        raise InputError(f"{path} is not the URDF of a person as pybullet has it.")  # noqa: B904
    centre, size = np.array(box)
    ends = np.array([[-size[0] / 2, -size[1] / 2, 0], [size[0] / 2, -size[1] / 2, 0]])
    return Skeleton(parents, offsets, centre + ends)


def pose(skeleton: Skeleton, capture: Capture, unit: float = UNIT) -> dict[str, Array]:
    """Returns the points of a body by name, in m and the file's axes, (T, 3) each.

    They are joints, and heels and toes at the sole; ``unit`` is the skeleton's, in m.
    """
    q = {"root": capture.rotations["root"]}
    p = {"root": np.zeros_like(capture.root)}
    for name, parent in skeleton.parents.items():
        p[name] = p[parent] + quat_rotate(q[parent], skeleton.offsets[name])
        if name in capture.rotations:
            q[name] = quat_multiply(q[parent], capture.rotations[name])
    for side in SIDES:
        ankle = f"{side}_ankle"
        for end, offset in zip(("heel", "toe"), skeleton.soles, strict=True):
            p[f"{side}_{end}"] = p[ankle] + quat_rotate(q[ankle], offset)
    return {name: capture.root + unit * points for name, points in p.items()}


def repeated(clip: BipedClip, loop: bool, cycles: int) -> BipedClip:
    """Returns a clip played several times in a row, closed where it is not quite.

    Where one ends and the next begins, what does not fit is spread over the cycle.

    Raises:
        InputError: if it does not begin as it ends.
    """
    if cycles < 1:
        raise InputError(f"it can be played once or more, not {cycles} times.")
    if cycles == 1:
        return clip
    parts = [clip.spine.reshape(len(clip), -1, 3)]
    parts += [part.reshape(len(clip), -1, 3) for part in (clip.legs, clip.arms)]
    points = np.concatenate(parts, axis=1)
    travel = (points[-1, 0] - points[0, 0]) * np.array([1.0, 1.0, 0.0])
    # The last frame is the first of the next cycle, or that before it.
    ahead = points[-1] + (points[-1] - points[-2])
    gaps = [points[0] + travel - points[-1], points[0] + travel - ahead]
    step = (points[1, 0] - points[0, 0]) * np.array([1.0, 1.0, 0.0])
    gaps[1] = gaps[1] + step
    late = int(np.abs(gaps[1]).max() < np.abs(gaps[0]).max())
    gap, travel = gaps[late], travel + late * step
    off = float(np.linalg.norm(gap, axis=-1).max())
    if not loop or off > CLOSED:
        raise InputError(
            f"it cannot be played {cycles} times, since it does not end as it begins: "
            f"a point is off by {off:.2g} m."
        )
    frames = len(clip) - 1 + late
    share = np.arange(frames)[:, None, None] / frames
    cycle = points[:frames] + share * gap
    once_more = [cycle + k * travel for k in range(cycles)]
    points = np.concatenate((*once_more, cycle[:1] + cycles * travel))
    spine, legs, arms = np.split(points, [3, 13], axis=1)
    return BipedClip(
        source=clip.source,
        gait=clip.gait,
        fps=clip.fps,
        spine=spine,
        legs=legs.reshape(-1, 2, len(LEG), 3),
        arms=arms.reshape(-1, 2, len(ARM), 3),
        provenance={
            **clip.provenance,
            "cycles": f"{cycles}, each closed by {off:.3f} m",
        },
    )


def _clip(
    path: Path, gait: str | None, capture: Capture, points: Mapping[str, Array]
) -> BipedClip:
    """Returns points at a constant rate, z up if y is in the file."""
    steps = np.diff(capture.time)
    fps = check_rate(round(1 / float(np.median(steps)), 1))
    notes = {}
    if np.abs(steps * fps - 1).max() > 0.01:
        notes["rate"] = "frames of unequal duration were interpolated"
    count = int(capture.time[-1] * fps + 1e-3) + 1
    new = np.minimum(np.arange(count) / fps, capture.time[-1])
    splines = {
        name: CubicSpline(capture.time, values)(new) for name, values in points.items()
    }

    def together(names: tuple[str, ...]) -> Array:
        pairs = [[splines[f"{side}_{name}"] for name in names] for side in SIDES]
        return np.moveaxis(np.array(pairs), 2, 0)

    legs = together(LEG)
    pelvis = legs[:, :, 0].mean(axis=1)
    spine = np.stack((pelvis, splines["chest"], splines["neck"]), axis=1)
    assert len(SPINE) == spine.shape[1]
    return BipedClip(
        source=SOURCE,
        gait=gait or path.stem.removeprefix(PREFIX).replace("_", ""),
        fps=fps,
        spine=spine,
        legs=legs,
        arms=together(ARM),
        provenance={
            "file": path.name,
            "frames": f"0-{len(capture.time)}",
            **notes,
            "licence": LICENCE,
            "attribution": ATTRIBUTION,
        },
    )


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
