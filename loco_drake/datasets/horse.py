"""The Haflinger horses of the Vienna Horse Data Collection, on a treadmill.

A recording has one of two formats with 7 markers (head, withers, sacrum, lateral walls
of the hooves FL, FR, RL, RR), z up:

* raw, with a header: frame, time in s and 21 coordinates in mm, x forward, y left in
  the treadmill's frame; missing markers are gaps;
* 21 columns without header, in metres, with x and y in an estimate of the world, in
  which stance hooves slide at .15 m/s.

Hooves in stance stand on the belt, so the trunk moves over it with their negated
velocity relative to the trunk. Only positions relative to the withers are used, since
the trunk's own path is in the treadmill's frame or an estimate of the world, so both
formats give the same clip.
"""

import re
from pathlib import Path

import numpy as np
from scipy.interpolate import make_smoothing_spline
from scipy.ndimage import binary_erosion

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.gravity import GRAVITY
from loco_drake.datasets.conventions import (
    ground_height,
    orient,
    stride_of,
)
from loco_drake.datasets.gaps import LONGEST_GAP, mend_gaps, usable_stretch
from loco_drake.datasets.recording import (
    Body,
    Recording,
    all_seen,
    check_frames,
    check_rate,
    check_told,
    read_lines,
    read_named_table,
    read_table,
)

MARKERS = ("Head", "Withers", "Sacrum", "HFL", "HFR", "HHL", "HHR")
RAW_COLUMNS = ("Time", *(f"{marker}{axis}" for marker in MARKERS for axis in "XYZ"))

# First day of measurement 60 frames/s, second and third 120; the name tells the day.
RATES = (60.0, 120.0)
RATE_OF_DAY = {"1": 60.0, "2": 120.0, "3": 120.0}

# Haflingers measure 1.25 to 1.35 m at the withers, .68 to .85 m from there to the
# sacrum; their strides last 1.7 to 3.3 units of time.
BODY = Body(trunk=(0.4, 1.3), height=(0.9, 1.9), stride=(1.2, 4.5), jump=0.17)
# Times are rounded to 1 ms.
TIME_TOLERANCE = 0.003

# The stride period over sqrt(withers height / g): in 96 recordings of eleven Haflingers
# whose rate is known it is 2.38 to 3.25 in a walk and 1.69 to 1.93 in a trot.
TYPICAL_PERIOD = {"walk": 2.8, "trot": 1.8}
# Diagonal hooves of a trot swing together: correlation of their fore-aft motion. In a
# walk it is near 0.
DIAGONAL = 0.6
# The two rates differ twofold, so the better one must be off by less than sqrt(2).
MAX_RATIO = 1.35

# Candidates for stance are markers this near to their lowest heights, m.
LOW = 0.02
LOW_PERCENTILE = 5.0
# They are in stance if they are not faster than this over the belt, m/s. In a trot the
# trunk's speed varies by .4 m/s, so the first pass, which uses its mean, is tolerant.
NEAR = (0.5, 0.3, 0.2)
# Time after touchdown and before lift-off in which a hoof slides or rolls, s.
EDGE_SECONDS = 0.02
# Of the trunk's velocity, Hz: the fifth harmonic of a trot's steps is noise.
CUTOFF = 8.0


def read_horse(
    path: Path, start: int | None, end: int | None, fps: float | None
) -> Recording:
    """Reads the frames without gaps around ``start`` to ``end``, without the treadmill.

    Without these, it is the longest stretch without gaps. The rate is that of the time
    column, of the day in the file's name (M1: 60, M2 and M3: 120) or of the strides, in
    this order.

    Raises:
        InputError: if the file is not of this format, the stretch not within it or has
            long gaps, its rate is not to be found, or ``fps`` not that of its strides.
    """
    header = read_lines(path)[0].lower().replace("nan", "").replace("inf", "")
    own_fps: float | None = None
    if re.search("[a-df-z]", header):  # words
        points, own_fps = _read_raw(path)
    else:
        points = read_table(path, 3 * len(MARKERS)).reshape(-1, len(MARKERS), 3)[:, 1:]
    notes: dict[str, str] = {}
    points = orient(points, BODY, notes)
    day = re.search(r"_M([123])(?![0-9])", path.stem)
    rate = fps or own_fps or (RATE_OF_DAY[day[1]] if day else None)
    told = _infer_rate(points)
    if told is not None:
        rate = check_told(told, rate)
    if rate is None:
        raise InputError(
            "it has no known rate: its name has no day of measurement (_M1_, _M2_ "
            "or _M3_) and its strides are too few, or not those of a horse; give its "
            "frames per second with --fps 60 or --fps 120."
        )
    points, bridged = mend_gaps(points, round(LONGEST_GAP * rate))
    if bridged:
        notes["gaps"] = f"{bridged} frames bridged"
    whole, first = usable_stretch(points, start, end)
    points = points[whole]
    velocity = _trunk_velocity(points, rate)
    moved = points - points[:, :1] * (1.0, 1.0, 0.0)
    steps = (velocity[1:] + velocity[:-1]) / (2 * rate)
    moved[1:, :, :2] += np.cumsum(steps, axis=0)[:, None]
    return Recording(moved, rate, whole.start, first, notes)


def _read_raw(path: Path) -> tuple[Array, float]:
    table = read_named_table(path, RAW_COLUMNS)
    time = table[:, 0]
    check_frames(time)
    if not np.isfinite(time).all():
        raise InputError("its time column is incomplete.")
    step = (time[-1] - time[0]) / (len(time) - 1)
    rate = check_rate(1 / step) if step > 0 else 0.0
    regular = np.abs(time - (time[0] + step * np.arange(len(time)))) < TIME_TOLERANCE
    if not rate or not regular.all():
        line = int(np.argmin(regular)) + 2
        raise InputError(
            f"at line {line} the time steps are uneven (are lines missing or out "
            "of order?)."
        )
    points = table[:, 1:].reshape(-1, len(MARKERS), 3)[:, 1:] / 1000
    # Whole frames per second, as far as 1 ms in the duration lets them be told.
    whole = float(round(rate))
    return points, whole if abs(whole / rate - 1) < 0.02 else rate


def _infer_rate(points: Array) -> float | None:
    """Returns the rate at which the strides in points (T, 6, 3) match a horse's.

    Animals of similar build have similar strides when time is scaled by sqrt(height /
    g) (Alexander and Jayes 1983); walk and trot are distinguished without a clock. Gaps
    are left out. Returns None if there are too few strides, or no rate matches.
    """
    points = points[all_seen(points)]
    if len(points) < 8:
        return None
    height = float(np.median(points[:, 0, 2]) - ground_height(points))
    if (frames := stride_of(points, height, strides=2)) is None:
        return None
    forward = (points[:, 0] - points[:, 1])[:, :2]
    relative = (points[:, 2:] - points[:, :1])[..., :2]
    correlation = np.corrcoef((relative * forward[:, None]).sum(axis=-1).T)
    trots = (correlation[0, 3] + correlation[1, 2]) / 2 > DIAGONAL
    typical = TYPICAL_PERIOD["trot" if trots else "walk"]
    seconds = typical * np.sqrt(height / GRAVITY)
    ratios = {rate: abs(np.log(frames / rate / seconds)) for rate in RATES}
    best = min(RATES, key=lambda rate: ratios[rate])
    return best if ratios[best] < np.log(MAX_RATIO) else None


def _trunk_velocity(points: Array, fps: float) -> Array:
    """Returns the trunk's horizontal velocity over the belt in m/s, shape (T, 2).

    It is the negated mean relative velocity of the hooves in stance, interpolated
    through flight phases, in which nothing propels the trunk, and smoothed. Raises
    InputError if no hoof ever stands.
    """
    relative, heights = (points[:, 2:] - points[:, :1])[..., :2], points[:, 2:, 2]
    time = np.arange(len(relative)) / fps
    hoof_velocity = np.gradient(relative, 1 / fps, axis=0)
    height = heights - np.percentile(heights, LOW_PERCENTILE, axis=0)
    low = height < LOW
    edge = round(EDGE_SECONDS * fps)
    middle = np.ones((2 * edge + 1, 1), dtype=bool)
    mean = -np.median(hoof_velocity[height < LOW / 2], axis=0)
    velocity: Array = np.broadcast_to(mean, (len(relative), 2))
    for near in NEAR:
        over_belt = np.linalg.norm(hoof_velocity + velocity[:, None], axis=-1)
        stance = binary_erosion(low & (over_belt < near), middle, border_value=1)
        count = stance.sum(axis=1)
        seen = count > 0
        if not seen.any():
            raise InputError(
                "No hoof ever stands on the treadmill, so the horse's speed is not "
                "known (are the hooves' columns in order?)."
            )
        total = (hoof_velocity * stance[..., None]).sum(axis=1)
        measured = -total[seen] / count[seen, None]
        between = [np.interp(time, time[seen], component) for component in measured.T]
        # min sum (x - y)^2 + s integral x''^2 halves the amplitude of CUTOFF.
        stiffness = fps / (2 * np.pi * CUTOFF) ** 4
        filled = np.stack(between, axis=-1)
        velocity = make_smoothing_spline(time, filled, lam=stiffness)(time)
    return velocity
