"""The simulated robot Solo8 of CASSI.

CASSI: Li, Blaes, Kolev, Vlastelica, Frey, Martius (ICRA 2023). A file holds 27 columns:
centre of the trunk; hips FL, FR, RL, RR; feet FL, FR, RL, RR; 50 frames a second. A
foot is the centre of its ball. Each run begins with a drop from .34 m, in which nothing
of a gait is seen.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.datasets.normalize import check_range, start_along_x
from loco_drake.datasets.simulated import read_points, trunk_ends
from loco_drake.motion.keypoints import KeypointClip

FORMAT = "a solo8 keypoint file"
FPS = 50.0
# Of the front left hip in the trunk's frame, m.
HALF_SIZE = (0.19, 0.104)
FOOT_RADIUS = 0.0155

# It lands within 9 frames and has settled after 20, all in the 168 runs at hand.
SETTLED = 20
# No gait lifts all four feet this high: m over the ground, lowest point.
AIRBORNE = 0.05


def read_solo8(
    path: Path,
    *,
    gait: str,
    start: int | None = None,
    end: int | None = None,
    fps: float | None = None,
) -> KeypointClip:
    """Reads frames ``start`` to ``end`` (exclusive) of a simulated run.

    Withers and hip are the middles of the front and rear hips; toes are the lowest
    points of the feet's balls.

    Args:
        path: a keypoint text file.
        gait: what the robot does.
        start: first frame, from 0; None for the first after the drop and settling.
        end: frame after the last; None for the end of the file.
        fps: frames per second; None for the format's 50.

    Raises:
        InputError: if the file is not of this format, or the stretch not within it or
            beginning while the robot still drops.
    """
    path = Path(path)
    points = read_points(path, FORMAT)
    centre, hips, feet = points[:, 0], points[:, 1:5], points[:, 5:]
    withers, hip = trunk_ends(centre, hips, HALF_SIZE, path, FORMAT)
    toes = feet - np.array([0.0, 0.0, FOOT_RADIUS])
    landing = _landing(toes)
    if start is None and landing > 0:
        start = min(SETTLED, len(points) - 1)
    first, stop = check_range(start, end, len(points), path.name)
    if first < landing:
        raise InputError(
            f"{path}: the robot drops to the ground until frame {landing}; start there "
            f"or later, best at frame {SETTLED}."
        )
    withers, hip, toes = start_along_x(
        withers[first:stop], hip[first:stop], toes[first:stop]
    )
    return KeypointClip(
        source="solo8",
        gait=gait,
        fps=fps or FPS,
        withers=withers,
        hip=hip,
        toes=toes,
        provenance={"file": path.name, "frames": f"{first}-{stop}"},
    )


def _landing(toes: NDArray[np.float64]) -> int:
    """Returns the first frame in which a foot is down; 0 without a drop before it."""
    lowest = toes[..., 2].min(axis=1)
    if lowest[0] < AIRBORNE:
        return 0
    landed = lowest < FOOT_RADIUS / 2
    return int(np.argmax(landed)) if landed.any() else len(toes)
