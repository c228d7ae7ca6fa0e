"""The dog of the MANN motion capture (Zhang, Starke, Komura, Saito, SIGGRAPH 2018).

A recording has one of two formats, both y up, right-handed, 60 frames/s, with the toes
of a standing dog near y = 0:

* keypoints: 81 columns without header, 27 points x (x, y, z) in metres;
* BVH: a skeleton in centimetres and joint angles, from which the same 27 points follow,
  at another place in the plane.
"""

from pathlib import Path

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.datasets.bvh import END_SITE, parse_bvh
from loco_drake.datasets.recording import (
    Body,
    Recording,
    read_lines,
    read_table,
)

FPS = 60.0
COLUMNS = 81

# Indices of withers, hip, toes FL, FR, RL, RR. The withers are the base of the neck,
# which lies on the spine like the hip. The shoulder points (6, 11) are 3 cm lower and
# would pitch the trunk by another four degrees. Front toes in stance are marked 2 cm
# above the ground, rear toes at 0.
POINTS = (3, 0, 10, 15, 19, 23)
# The same in the skeleton; other joints may lie between, before and behind these.
_SPINE, _CHEST = ("Hips", "Spine", "Spine1"), ("Hips", "Spine", "Spine1")
CHAINS = (
    (*_SPINE, "Neck"),
    ("Hips",),
    (*_CHEST, "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", END_SITE),
    (*_CHEST, "RightShoulder", "RightArm", "RightForeArm", "RightHand", END_SITE),
    ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", END_SITE),
    ("Hips", "RightUpLeg", "RightLeg", "RightFoot", END_SITE),
)

# The capture's one dog measures .41 m from hip to withers and stands .44 m high; its
# strides last 1.8 to 3.6 units of time.
BODY = Body(trunk=(0.2, 0.8), height=(0.1, 1.0), stride=(1.3, 4.2), jump=0.25)


def read_dog(
    path: Path, start: int | None, end: int | None, fps: float | None
) -> Recording:
    """Reads a dog recording in either format; the default rate is 60, or the BVH's.

    Raises:
        InputError: if the file is not of this format.
    """
    lines = read_lines(path)
    if path.suffix.lower() != ".bvh" and lines[0].strip().upper() != "HIERARCHY":
        points = read_table(path, COLUMNS).reshape(-1, COLUMNS // 3, 3)
        return Recording(_z_up(points[:, POINTS]), fps or FPS)
    bvh = parse_bvh(lines)
    try:
        found = [bvh.find(chain) for chain in CHAINS]
    except LookupError as missing:
        names = dict.fromkeys(name for chain in CHAINS for name in chain)
        raise InputError(
            f"its skeleton is another, which lacks {missing} where a dog's has it; "
            "that has the joints "
            f"{', '.join(name for name in names if name != END_SITE)}; for another "
            "animal, loco-drake data inspect FILE --skeleton proposes what to name."
        ) from None
    points = bvh.positions()[:, found] / 100
    # The file rounds the time of a frame to six digits.
    return Recording(_z_up(points), fps or round(bvh.fps, 2))


def _z_up(points: Array) -> Array:
    up: Array = points[..., [0, 2, 1]] * (1.0, -1.0, 1.0)
    return up
