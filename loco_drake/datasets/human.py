"""Human motion as pybullet ships it, as keypoints; see :mod:`.human_file`.

In the files y points up, x forward and z to the right, which is measured.
"""

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.rotations import (
    quat_conjugate,
    quat_exp,
    quat_log,
    quat_multiply,
    quat_rotate,
)
from loco_drake.datasets.human_conventions import (
    UP,
    check_reading,
    other_readings,
    settle,
)
from loco_drake.datasets.human_file import (
    Capture,
    Skeleton,
    find_skeleton,
    read_capture,
    read_skeleton,
)
from loco_drake.datasets.recording import check_rate
from loco_drake.motion.biped_clip import ARM, LEG, SIDES, SPINE, BipedClip

SOURCE, FOLDER = "human", "human_pybullet"
LICENCE = "zlib (of pybullet; the origin of the capture is not stated)"
ATTRIBUTION = "Coumans and Bai (pybullet 3.2.7), in the format of Peng et al. 2018"
PREFIX = "humanoid3d_"  # of clips' names
UNIT = 0.25  # m in a unit of the URDF
CLOSED = 0.5  # rad; the joints of what begins as it ends are off by less


def read_human(path: Path, gait: str | None = None, cycles: int = 1) -> BipedClip:
    """Returns a clip, its conventions measured; see :mod:`.human_conventions`.

    Args:
        path: the clip; its skeleton is found beside it.
        gait: what it shows; by default its file's name tells.
        cycles: how often it is played in a row, if it ends as it begins, with feet on
            the ground.

    Raises:
        InputError: if a file is missing or damaged, or contradicts its format.
    """
    path = Path(path)
    try:
        capture = read_capture(path)
        skeleton = read_skeleton(find_skeleton(path))
        try:
            clip = settle(_clip(path, gait, capture, skeleton))
        except InputError:
            _name_reading(path, capture, skeleton)
            raise
        check_reading(capture, lambda other: pose(skeleton, other))
        if cycles > 1:
            clip = _played(path, clip, repeated(capture, cycles), skeleton)
        return clip
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path} cannot be read as human motion: {error}") from None


def _name_reading(path: Path, capture: Capture, skeleton: Skeleton) -> None:
    """Raises InputError if the body stands with rotations read in another way."""
    for how, other in other_readings(capture).items():
        try:
            settle(_clip(path, None, other, skeleton))
        except InputError:
            continue
        raise InputError(f"its body stands only if its quaternions are {how}.")


def _played(
    path: Path, once: BipedClip, capture: Capture, skeleton: Skeleton
) -> BipedClip:
    """Returns a capture's clip, or that of one cycle if feet leave the ground in it."""
    try:
        return settle(_clip(path, once.gait, capture, skeleton))
    except InputError:
        return once


def pose(skeleton: Skeleton, capture: Capture) -> dict[str, Array]:
    """Returns the points of a body by name, in m and the file's axes, (T, 3) each.

    They are joints, and heels and toes at the sole.
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
    return {name: capture.root + UNIT * points for name, points in p.items()}


def repeated(capture: Capture, cycles: int) -> Capture:
    """Returns a capture played several times in a row, each from where it ended.

    What does not fit is spread over the cycle, joint by joint. A capture that does not
    end as it begins, or says that it is no loop, is returned as it is.
    """
    if cycles == 1 or not capture.loop:
        return capture
    q, root = capture.rotations, capture.root
    # The last frame is the first of the next cycle, or that before it.
    turns = [{name: _turn(v[-1], v[0]) for name, v in q.items()}, {}]
    for name, v in q.items():
        after = quat_multiply(v[-1], quat_exp(_turn(v[-2], v[-1])))
        turns[1][name] = _turn(after, v[0])
    gaps = [max(float(np.linalg.norm(v)) for v in turn.values()) for turn in turns]
    late = int(gaps[1] < gaps[0])
    if gaps[late] > CLOSED:
        return capture
    frames = len(root) - 1 + late
    share = np.arange(frames)[:, None] / frames
    step = np.median(np.diff(capture.time))
    rotations = {
        name: np.tile(
            quat_multiply(v[:frames], quat_exp(share * turns[late][name])), (cycles, 1)
        )
        for name, v in q.items()
    }
    level = np.eye(3)[UP]
    travel = root[-1] - root[0] + late * (root[-1] - root[-2])
    # It ends as high as it begins.
    cycle = root[:frames] - share * (travel @ level) * level
    travel = travel - (travel @ level) * level
    return Capture(
        time=np.arange(cycles * frames) * step,
        root=np.concatenate([cycle + k * travel for k in range(cycles)]),
        rotations=rotations,
        loop=True,
        frames=capture.frames,
        notes={"cycles": f"{cycles}, closed by {np.degrees(gaps[late]):.0f} degrees"},
    )


def _turn(q_from: Array, q_to: Array) -> Array:
    """Returns the rotation vector from one quaternion (4,) to another, in its frame."""
    return quat_log(quat_multiply(quat_conjugate(q_from), q_to))


def _clip(
    path: Path, gait: str | None, capture: Capture, skeleton: Skeleton
) -> BipedClip:
    """Returns points at a constant rate, z up if y is in the file."""
    points = pose(skeleton, capture)
    steps = np.diff(capture.time)
    fps = check_rate(round(1 / float(np.median(steps)), 1))
    notes = dict(capture.notes)
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
            "frames": f"0-{capture.frames}",
            **notes,
            "licence": LICENCE,
            "attribution": ATTRIBUTION,
        },
    )
