"""The dog of the MANN motion capture (Zhang, Starke, Komura, Saito, SIGGRAPH 2018).

A file holds 81 comma-separated columns and no header: 27 points x (x, y, z) in
metres, y up, right-handed, 60 frames a second, toes of a standing dog near y = 0.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.datasets.normalize import (
    check_range,
    check_steps,
    ground_toes,
    start_along_x,
)
from loco_drake.datasets.text import read_table
from loco_drake.errors import InputError
from loco_drake.keypoints import KeypointClip

FPS = 60.0
COLUMNS = 81
FORMAT = "a dog keypoint file"

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
        path: a keypoint text file of the MANN dog.
        gait: what the dog does in that stretch.
        start: first frame, from 0; None for the start of the file.
        end: frame after the last; None for the end of the file.
        fps: frames per second; None for the format's 60.

    Raises:
        InputError: if the file is not of this format, or the stretch not within it.
    """
    path = Path(path)
    table = read_table(path, COLUMNS, FORMAT)
    start, end = check_range(start, end, len(table), path.name)
    points = table.reshape(-1, COLUMNS // 3, 3)
    points = points[..., [0, 2, 1]] * (1.0, -1.0, 1.0)  # y up to z up
    _check_points(points, path)
    toes = ground_toes(points[:, TOES], STANCE_PERCENTILE)
    withers, hip, toes = start_along_x(
        points[start:end, WITHERS], points[start:end, HIP], toes[start:end]
    )
    return KeypointClip(
        source="dog",
        gait=gait,
        fps=fps or FPS,
        withers=withers,
        hip=hip,
        toes=toes,
        provenance={"file": path.name, "frames": f"{start}-{end}"},
    )


def _check_points(points: NDArray[np.float64], path: Path) -> None:
    """Raises InputError for numbers that cannot be a dog's points (T, 27, 3) in m."""
    trunk = np.linalg.norm(points[:, WITHERS] - points[:, HIP], axis=-1)
    length = float(np.median(trunk))
    low, high = TRUNK_LENGTHS
    if not low <= length <= high:
        raise InputError(
            f"{path} is not {FORMAT}: the trunk would be {length:.3g} m "
            f"long, not {low} to {high} m (are these metres?)."
        )
    check_steps(points[:, [WITHERS, HIP, *TOES]], MAX_STEP, path, FORMAT)
