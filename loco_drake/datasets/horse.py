"""The Haflinger horses of the Vienna Horse Data Collection, on a treadmill.

Two forms of a recording with 7 markers (head, withers, sacrum, lateral walls of the
hooves FL, FR, RL, RR), z up:

* raw, with a header: frame, time in s and 21 coordinates in mm, x forward, y left in
  the treadmill's frame; a marker that was not seen leaves a gap;
* 21 columns without header, in metres, x and y moved to somebody's estimate of the
  world, whose stance hooves slide at .15 m/s.

Of both only positions relative to the withers are used, see
:mod:`loco_drake.datasets.treadmill`, so that both give the same clip.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from loco_drake.common.errors import InputError
from loco_drake.datasets.gaps import mend_gaps, usable_stretch
from loco_drake.datasets.normalize import check_steps, ground_toes, start_along_x
from loco_drake.datasets.strides import infer_rate
from loco_drake.datasets.text import read_lines, read_named_table, read_table
from loco_drake.datasets.treadmill import trunk_path
from loco_drake.motion.keypoints import KeypointClip

Array = NDArray[np.float64]

FORMAT = "a horse keypoint file"
MARKERS = ("Head", "Withers", "Sacrum", "HFL", "HFR", "HHL", "HHR")
RAW_COLUMNS = ("Time", *(f"{marker}{axis}" for marker in MARKERS for axis in "XYZ"))

# First day of measurement 60 frames/s, second and third 120; the name tells the day.
RATES = (60.0, 120.0)
RATE_OF_DAY = {"1": 60.0, "2": 120.0, "3": 120.0}

# Hooves stand for a third of a trot; markers sit up to 25 mm off, each its own.
STANCE_PERCENTILE = 10.0

# Sanity: Haflingers measure 1.25 to 1.35 m at the withers, .68 to .85 m from there to
# the sacrum; a hoof swings at no more than 12 m/s.
TRUNK_LENGTHS = (0.4, 1.3)
WITHERS_HEIGHTS = (0.9, 1.9)
MAX_STEP = 0.4
# Gaps up to this long are bridged, s.
LONGEST_GAP = 0.1
# Times are rounded to 1 ms.
TIME_TOLERANCE = 0.003


@dataclass(frozen=True)
class _Recording:
    """Points withers, sacrum and hooves in m, shape (T, 6, 3), and their rate."""

    points: Array
    fps: float | None


def read_horse(
    path: Path,
    *,
    gait: str,
    start: int | None = None,
    end: int | None = None,
    fps: float | None = None,
) -> KeypointClip:
    """Reads frames ``start`` to ``end`` (exclusive) of a horse on a treadmill.

    The treadmill is undone. Pairs of hooves whose left and right markers are swapped
    are swapped back. Heights are corrected hoof by hoof over the whole recording: the
    tenth percentile becomes the ground. What was mended stands in the provenance.

    Args:
        path: a recording in either form.
        gait: what the horse does.
        start: first frame, from 0; None for the start of the file or, if it has gaps
            too long to bridge, of its longest stretch without.
        end: frame after the last; None for the end of the file or that stretch.
        fps: frames per second; None to take them from the time column, the day in the
            file's name (M1: 60, M2 and M3: 120) or the strides, in this order.

    Raises:
        InputError: if the file is not of this format, the stretch not within it or has
            long gaps, or its rate is not to be found.
    """
    path = Path(path)
    recording = _read_raw(path) if _has_header(path) else _read_world(path)
    points, swapped = unswap(recording.points)
    notes = {}
    if swapped:
        notes["swapped"] = f"left and right {' and '.join(swapped)} hooves"
    rate = fps or recording.fps or _rate(points, path)
    points, bridged = mend_gaps(points, round(LONGEST_GAP * rate))
    if bridged:
        notes["gaps"] = f"{bridged} frames bridged"
    whole, first, stop = usable_stretch(points, start, end, path.name)
    points = points[whole]
    _check_points(points, path)

    moved = points - points[:, :1] * (1.0, 1.0, 0.0)
    moved[..., :2] += trunk_path(points[:, 0], points[:, 2:], rate)[:, None]
    toes = ground_toes(moved[:, 2:], STANCE_PERCENTILE)
    part = slice(first - whole.start, stop - whole.start)
    withers, hip, toes = start_along_x(moved[part, 0], moved[part, 1], toes[part])
    return KeypointClip(
        source="horse",
        gait=gait,
        fps=rate,
        withers=withers,
        hip=hip,
        toes=toes,
        provenance={"file": path.name, "frames": f"{first}-{stop}", **notes},
    )


def unswap(points: Array) -> tuple[Array, list[str]]:
    """Returns points whose left hooves are on the left, and which pairs were swapped.

    Hooves are some 15 cm from the midline, so the mean over a recording tells.

    Args:
        points: withers, sacrum, hooves FL, FR, RL, RR in m, shape (T, 6, 3).
    """
    forward = (points[:, 0] - points[:, 1])[:, :2]
    left = np.stack((-forward[:, 1], forward[:, 0]), axis=-1)
    points, swapped = points.copy(), []
    for name, k in (("front", 2), ("rear", 4)):
        apart = (points[:, k] - points[:, k + 1])[:, :2]
        if np.nanmean((apart * left).sum(axis=-1)) < 0:
            points[:, [k, k + 1]] = points[:, [k + 1, k]]
            swapped.append(name)
    return points, swapped


def _has_header(path: Path) -> bool:
    """Returns whether the first line holds words."""
    first = read_lines(path, FORMAT)[0].lower().replace("nan", "").replace("inf", "")
    return re.search("[a-df-z]", first) is not None


def _read_raw(path: Path) -> _Recording:
    table = read_named_table(path, RAW_COLUMNS, FORMAT)
    time = table[:, 0]
    if len(time) < 2 or not np.isfinite(time).all():
        raise InputError(f"{path} is not {FORMAT}: its time column is incomplete.")
    step = (time[-1] - time[0]) / (len(time) - 1)
    regular = np.abs(time - (time[0] + step * np.arange(len(time)))) < TIME_TOLERANCE
    if step <= 0 or not regular.all():
        line = int(np.argmin(regular)) + 2
        raise InputError(
            f"{path} is not {FORMAT}: at line {line} the time does not go on evenly "
            "(are lines missing or out of order?)."
        )
    points = table[:, 1:].reshape(-1, len(MARKERS), 3)[:, 1:] / 1000
    # Whole frames per second, as far as 1 ms in the duration lets them be told.
    rate = 1 / step
    whole = float(round(rate))
    return _Recording(points, whole if abs(whole / rate - 1) < 0.02 else rate)


def _read_world(path: Path) -> _Recording:
    points = read_table(path, 3 * len(MARKERS), FORMAT).reshape(-1, len(MARKERS), 3)
    return _Recording(points[:, 1:], None)


def _rate(points: Array, path: Path) -> float:
    """Returns frames per second, by the day in the name, else by the strides."""
    day = re.search(r"_M([123])(?![0-9])", path.stem)
    if day:
        return RATE_OF_DAY[day.group(1)]
    forward = (points[:, 0] - points[:, 1])[:, :2]
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    relative = (points[:, 2:] - points[:, :1])[..., :2]
    fore_aft = (relative * forward[:, None]).sum(axis=-1)
    rate = infer_rate(fore_aft, float(np.median(points[:, 0, 2])), RATES)
    if rate is None:
        raise InputError(
            f"{path} does not tell its rate: its name has no day of measurement (_M1_, "
            "_M2_ or _M3_) and its strides are too few, or not those of a horse; give "
            "its frames per second with --fps 60 or --fps 120."
        )
    return rate


def _check_points(points: Array, path: Path) -> None:
    """Raises InputError for numbers that cannot be a horse's points in m."""
    trunk = float(np.median(np.linalg.norm(points[:, 0] - points[:, 1], axis=-1)))
    height = float(np.median(points[:, 0, 2]))
    for what, value, (low, high) in (
        ("trunk would be {} m long", trunk, TRUNK_LENGTHS),
        ("withers would be {} m high", height, WITHERS_HEIGHTS),
    ):
        if not low <= value <= high:
            raise InputError(
                f"{path} is not {FORMAT}: the {what.format(f'{value:.3g}')}, not {low} "
                f"to {high} m (is the unit right: mm with a header, else m?)."
            )
    check_steps(points - points[:, :1] * (1.0, 1.0, 0.0), MAX_STEP, path, FORMAT)
