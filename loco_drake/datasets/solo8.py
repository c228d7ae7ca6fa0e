"""The simulated robot Solo8 of CASSI.

CASSI: Li, Blaes, Kolev, Vlastelica, Frey, Martius (ICRA 2023). A file has 27 columns:
centre of the trunk; hips FL, FR, RL, RR; feet FL, FR, RL, RR; at 50 frames/s. A foot is
the centre of its ball. Each run begins with a drop from .34 m, which is not part of the
gait.
"""

from pathlib import Path

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.datasets.conventions import ground_height, orient
from loco_drake.datasets.recording import Body, Recording
from loco_drake.datasets.simulated import read_robot

FPS = 50.0
# Of the front left hip in the trunk's frame, m.
HALF_SIZE = (0.19, 0.104)
FOOT_RADIUS = 0.0155
BODY = Body(height=(0.05, 0.4), stride=(1.3, 9.0), jump=0.35, markers=False)

# In all 168 runs it lands within 9 frames and has settled after 20.
SETTLED = 20
# Height of the lowest foot that no gait reaches, m.
AIRBORNE = 0.05


def read_solo8(
    path: Path, start: int | None, end: int | None, fps: float | None
) -> Recording:
    """Reads a simulated run, usable from where it has settled after the drop.

    Toes are the lowest points of the feet's balls. The default rate is 50.

    Raises:
        InputError: if the file is not of this format, or ``start`` in the drop.
    """
    points = read_robot(path, HALF_SIZE, centre=0, hips=1, feet=5)
    notes: dict[str, str] = {}
    points = orient(points, BODY, notes)
    points[:, 2:, 2] -= FOOT_RADIUS
    landing = _landing(points[:, 2:, 2].min(axis=1) - ground_height(points))
    if start is not None and start < landing:
        raise InputError(
            f"the robot drops to the ground until frame {landing}; start there or "
            f"later, best at frame {SETTLED}."
        )
    settled = min(SETTLED, len(points) - 1) if landing > 0 else None
    return Recording(points, fps or FPS, start=settled, notes=notes)


def _landing(lowest: Array) -> int:
    """Returns the first frame with a foot on the ground; 0 if there is no drop."""
    if lowest[0] < AIRBORNE:
        return 0
    landed = lowest < FOOT_RADIUS / 2
    return int(np.argmax(landed)) if landed.any() else len(lowest)
