"""The dog of the MANN motion capture (Zhang, Starke, Komura, Saito, SIGGRAPH 2018).

Two forms of a recording, both y up, right-handed, 60 frames a second, toes of a
standing dog near y = 0:

* keypoints: 81 comma-separated columns and no header, 27 points x (x, y, z) in metres;
* BVH: the skeleton in centimetres and its joint angles, from which the same 27 points
  follow; they lie elsewhere in the plane.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.datasets.bvh import END_SITE, read_bvh
from loco_drake.datasets.normalize import (
    check_range,
    check_steps,
    ground_toes,
    start_along_x,
)
from loco_drake.datasets.text import read_lines, read_table
from loco_drake.motion.keypoints import KeypointClip

FPS = 60.0
COLUMNS = 81
FORMAT = "a dog keypoint file"
BVH_FORMAT = "a BVH file of the dog"

# The points in order; each chain ends in an end site.
SKELETON = (
    *("Hips", "Spine", "Spine1", "Neck", "Head", END_SITE),
    *("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", END_SITE),
    *("RightShoulder", "RightArm", "RightForeArm", "RightHand", END_SITE),
    *("LeftUpLeg", "LeftLeg", "LeftFoot", END_SITE),
    *("RightUpLeg", "RightLeg", "RightFoot", END_SITE),
    *("Tail", "Tail1", END_SITE),
)

# Points of the skeleton. The withers are the point at the base of the neck: it lies on
# the spine as the hip does, whereas the shoulder points (6, 11) hang 3 cm below it,
# which would tilt the trunk down by four degrees more.
WITHERS = 3
HIP = 0
TOES = (10, 15, 19, 23)

# Standing front toes are marked 2 cm above the ground, rear toes at 0. A galloping dog
# has each foot down for a quarter of the time, so a tenth is well within stance.
STANCE_PERCENTILE = 10.0

# Sanity: the capture's one dog measures .41 m from hip to withers, and no point of a
# dog moves at 30 m/s.
TRUNK_LENGTHS = (0.2, 0.8)
MAX_STEP = 0.5  # m from one frame to the next


def read_dog(
    path: Path,
    *,
    gait: str,
    start: int | None = None,
    end: int | None = None,
    fps: float | None = None,
) -> KeypointClip:
    """Reads frames ``start`` to ``end`` (exclusive) of a dog recording.

    Toe heights are corrected foot by foot over the whole recording, whatever the
    stretch: its tenth percentile becomes the ground, z = 0.

    Args:
        path: a keypoint text file or a BVH file of the MANN dog.
        gait: what the dog does in that stretch.
        start: first frame, from 0; None for the start of the file.
        end: frame after the last; None for the end of the file.
        fps: frames per second; None for 60, or what the BVH file says.

    Raises:
        InputError: if the file is not of this format, or the stretch not within it.
    """
    path = Path(path)
    points, own_fps = _read_bvh(path) if _is_bvh(path) else _read_keypoints(path)
    start, end = check_range(start, end, len(points), path.name)
    points = points[..., [0, 2, 1]] * (1.0, -1.0, 1.0)  # y up to z up
    toes = ground_toes(points[:, TOES], STANCE_PERCENTILE)
    withers, hip, toes = start_along_x(
        points[start:end, WITHERS], points[start:end, HIP], toes[start:end]
    )
    return KeypointClip(
        source="dog",
        gait=gait,
        fps=fps or own_fps,
        withers=withers,
        hip=hip,
        toes=toes,
        provenance={"file": path.name, "frames": f"{start}-{end}"},
    )


def _is_bvh(path: Path) -> bool:
    if path.suffix.lower() == ".bvh":
        return True
    return read_lines(path, FORMAT)[0].strip() == "HIERARCHY"


def _read_keypoints(path: Path) -> tuple[NDArray[np.float64], float]:
    """Returns the points (T, 27, 3) in m, y up, and their rate."""
    points = read_table(path, COLUMNS, FORMAT).reshape(-1, COLUMNS // 3, 3)
    _check_points(points, path, FORMAT)
    return points, FPS


def _read_bvh(path: Path) -> tuple[NDArray[np.float64], float]:
    """Returns the points (T, 27, 3) in m, y up, and their rate."""
    bvh = read_bvh(path, BVH_FORMAT)
    if tuple(joint.name for joint in bvh.joints) != SKELETON:
        raise InputError(
            f"{path} is not {BVH_FORMAT}: its skeleton is another; that of the dog has "
            f"the joints {', '.join(name for name in SKELETON if name != END_SITE)}."
        )
    points = bvh.positions() / 100
    _check_points(points, path, BVH_FORMAT)
    # The file rounds the time of a frame to six digits.
    return points, round(bvh.fps, 2)


def _check_points(points: NDArray[np.float64], path: Path, what: str) -> None:
    """Raises InputError for numbers that cannot be a dog's points (T, 27, 3) in m."""
    trunk = np.linalg.norm(points[:, WITHERS] - points[:, HIP], axis=-1)
    length = float(np.median(trunk))
    low, high = TRUNK_LENGTHS
    if not low <= length <= high:
        raise InputError(
            f"{path} is not {what}: the trunk would be {length:.3g} m long, not {low} "
            f"to {high} m (is the unit of length that of the format?)."
        )
    check_steps(points[:, [WITHERS, HIP, *TOES]], MAX_STEP, path, what)
