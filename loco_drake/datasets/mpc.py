"""A robot of 5.5 kg under model-predictive control, simulated with RF-MPC.

RF-MPC: Ding, Pandala, Li, Shin, Park (T-RO 2021). A file holds 27 columns: feet FL, FR,
RL, RR; centre of the trunk; hips FL, FR, RL, RR; x forward. Each run is 5 s from rest,
in 500 rows of 100 or 1000 rows of 200 frames/s; the file does not say which.
"""

from pathlib import Path

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.errors import InputError
from loco_drake.common.runs import intervals
from loco_drake.datasets.conventions import orient
from loco_drake.datasets.recording import Body, Recording, check_told
from loco_drake.datasets.simulated import read_robot

# Of the front left hip in the trunk's frame, m.
HALF_SIZE = (0.1505, 0.044)

BODY = Body(height=(0.08, 0.4), stride=(0.5, 5.0), jump=0.28, markers=False)
# A larger shift of the ground, m, is reported.
GROUND = 0.02

RATES = (100.0, 200.0)
RUN_SECONDS = 5.0
# The controller's swings last .15 s (bound, gallop, trot), .10 s (crawl) or .05 s
# (pace); crawl alone has its feet down for more than two thirds of the stride.
SWING_SECONDS = (0.05, 0.15)
CRAWL_SWING_SECONDS = 0.10
CRAWL_DUTY = 0.68
# A swing counts half a frame too many on average, 10 % of the shortest.
SWING_TOLERANCE = 0.2

# Feet stand exactly still; the text has six decimals.
STILL = 1e-5


def read_mpc(
    path: Path, start: int | None, end: int | None, fps: float | None
) -> Recording:
    """Reads a simulated run; its default rate is inferred from the swings.

    The median height of all feet in stance becomes the ground: a pacing robot stands 12
    mm above that of its simulator.

    Raises:
        InputError: if the file is not of this format, or its rate not to be found or
            not that of its swings.
    """
    points = read_robot(path, HALF_SIZE, centre=4, hips=5, feet=0)
    notes: dict[str, str] = {}
    points = orient(points, BODY, notes)
    rate = _infer_rate(points[:, 2:], fps)
    feet = points[:, 2:]
    still = _still(feet)
    ground = float(np.median(feet[1:, :, 2][still])) if still.any() else 0.0
    if abs(ground) > GROUND:
        notes["ground"] = f"moved from z = {ground:.3f} m to 0"
    return Recording(points - np.array([0.0, 0.0, ground]), rate, notes=notes)


def _infer_rate(feet: Array, fps: float | None) -> float:
    """Returns the rate of feet (T, 4, 3) in frames/s, ``fps`` if it is plausible.

    The controller swings every foot for a fixed time, so the number of frames of a
    whole swing gives the rate. Without a whole swing, the length of the run does.
    Raises InputError if neither tells, or the swings contradict ``fps``.
    """
    still = _still(feet)
    swings = _whole_runs(~still)
    stances = _whole_runs(still)
    if len(swings) and len(stances):
        swing, stance = float(np.median(swings)), float(np.median(stances))
        crawls = stance > CRAWL_DUTY * (stance + swing)
        known = (CRAWL_SWING_SECONDS,) if crawls else SWING_SECONDS
        # The frame of lift-off and that of touchdown both count as moving.
        errors = {
            rate: min(abs((swing - 0.5) / rate / seconds - 1) for seconds in known)
            for rate in RATES
        }
        best = min(RATES, key=lambda rate: errors[rate])
        if errors[best] <= SWING_TOLERANCE:
            return check_told(best, fps)
    if fps is not None:
        return fps
    for rate in RATES:
        if len(feet) == round(rate * RUN_SECONDS):
            return rate
    raise InputError(
        "it has no known rate, since no foot swings in it as this controller has "
        "it; give its frames per second with --fps 100 or --fps 200."
    )


def _still(feet: Array) -> Bools:
    """Returns which feet do not move from one frame to the next, shape (T - 1, 4)."""
    still: Bools = np.linalg.norm(np.diff(feet, axis=0), axis=-1) < STILL
    return still


def _whole_runs(flags: Bools) -> list[int]:
    """Returns lengths of the runs of True in each column, except at its ends."""
    return [
        end - start
        for column in flags.T
        for start, end in intervals(column)
        if start > 0 and end < len(column)
    ]
