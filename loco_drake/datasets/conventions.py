"""Measures axes, sides, ground and rate of a recording, and corrects or refuses them.

The format of a file defines its up axis, the order of its toes and its rate, but files
in circulation often deviate. The motion contradicts a wrong convention: a trunk is
above its toes, left toes are left of it, feet stand on the ground, and a stride has a
plausible period under gravity (Alexander and Jayes 1983). The recordings of all readers
are checked here.
"""

from dataclasses import replace

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.gravity import GRAVITY
from loco_drake.datasets.recording import (
    Body,
    Recording,
    all_seen,
    check_frames,
    check_rate,
)
from loco_drake.motion.gait_timing import Track, stride_period

# The trunk's middle is this near to straight above the toes, as a cosine.
UPRIGHT = 0.9
# ... and even while an animal sits, or rears, no further from it than this.
ASKEW = 0.5
# Offsets of toes from the middle of the trunk that tell sides, in trunk lengths. In all
# recordings known here, left is .06 or more to the left of right, front .5 ahead.
SIDEWAYS, LENGTHWISE = 0.02, 0.1
# Orders of withers, hip and toes in which front and rear are exchanged.
TURNED = {
    "toes": [0, 1, 4, 5, 2, 3],
    "trunk": [1, 0, 2, 3, 4, 5],
    "trunk and toes": [1, 0, 4, 5, 2, 3],
}
# Markers of standing toes sit this low or high in each recording; the tenth percentile
# of a toe's height lies well within stance, which is a quarter of a gallop.
STANCE_PERCENTILE = 10.0
# Animals that lie or sit may stand for a twentieth of a recording only; then the trunk
# is above this of its height.
STANDING, STANDING_PERCENTILE = 0.65, 95.0
# A ground off by more, in body sizes, is the file's and not the markers'.
GROUND = 0.045
# Slope of the ground in degrees, told by toes that stand this far apart, in body sizes.
MAX_SLOPE, MIN_SPREAD = 15.0, 0.05
# Bounds of what a body does, in its sizes: the trunk's departure from a straight line
# within a frame, its length over the median, a toe's distance from it and depth.
TRUNK_JUMP = 0.12
TRUNK_STRETCH = 0.3
REACH = 1.7
DEPTH = 0.25
# Toes that move fore and aft by less take no strides.
STILL = 0.01
# Fastest trunk, in units of sqrt(g height); a greyhound reaches 7.
FASTEST = 10.0


def measure(recording: Recording, body: Body) -> Recording:
    """Returns a recording with corrected conventions, checked against its body.

    Raises:
        InputError: if the recording is implausible; names the frame or the figure.
    """
    points, notes = recording.points, dict(recording.notes)
    if points.shape[1:] != (6, 3) or not np.isfinite(points).all():
        raise InputError("it lacks points of the body.")
    check_rate(recording.fps)
    upright = orient(points, body, notes)
    points = _put_on_ground(upright, body, notes)
    recording = replace(recording, points=points, notes=notes)
    _check_motion(recording, body)
    _check_level(upright)
    return recording


def orient(points: Array, body: Body, notes: dict[str, str]) -> Array:
    """Returns points (T, 6, 3) in m with z up and toes in order, and notes corrections.

    Readers may call it themselves; correct points do not change. Frames in which a
    point is missing (NaN) are not judged.

    Raises:
        InputError: if the up axis is unclear, the size is implausible, or there are too
            few frames.
    """
    check_frames(points)
    if not all_seen(points).any():
        return points
    points = turn_up(points, notes)
    seen = points[all_seen(points)]
    for name, value, (low, high) in (
        ("long", _trunk_length(seen), body.trunk),
        ("high over the toes", _height(seen), body.height),
    ):
        if not low <= value <= high:
            raise InputError(
                f"the trunk would be {value:.3g} m {name}, not {low} to {high} m (is "
                "the unit of length that of the format?)."
            )
    return _name_toes(points, notes)


def turn_up(points: Array, notes: dict[str, str]) -> Array:
    """Returns points (T, 6, 3) with z up, and notes whether that turned them.

    Raises:
        InputError: if the trunk is above the toes along no axis.
    """
    seen = points[all_seen(points)]
    up = np.median(seen[:, :2].mean(axis=1) - np.median(seen[:, 2:], axis=1), axis=0)
    if not np.linalg.norm(up) > 0 or not _trunk_length(seen) > 0:
        raise InputError("the trunk has no length, or is in the ground.")
    cosines = up / np.linalg.norm(up)
    axis = int(np.argmax(np.abs(cosines)))
    if abs(cosines[axis]) < UPRIGHT:
        if cosines[2] > ASKEW:
            return points
        raise InputError(
            "the up axis is unclear, since along no axis is the trunk above "
            "the toes (are the columns those of the format?)."
        )
    if axis == 2 and cosines[2] > 0:
        return points
    notes["up"] = "turned upright, since another axis than the format's points up"
    return with_z_up(points, axis, cosines[axis] > 0)


def with_z_up(points: Array, axis: int, upward: bool = True) -> Array:
    """Returns points (..., 3) turned so that ``axis``, or its opposite, becomes z."""
    turned = points[..., [(axis + 1) % 3, (axis + 2) % 3, axis]]
    return turned if upward else turned * (1.0, -1.0, -1.0)


def _name_toes(points: Array, notes: dict[str, str]) -> Array:
    """Returns points with front toes in front and left toes on the left.

    Several exchanges can explain an observation. Animals mostly walk forward, so the
    path decides; without any path the smallest exchange is taken.
    """
    ahead, left, way = _offsets(points)
    crossed = left[[0, 2]] - left[[1, 3]] < -SIDEWAYS
    what = None
    if ahead[:2].mean() - ahead[2:].mean() < -LENGTHWISE:
        toes = not crossed.all() if abs(way) < 1 else way > 0
        what = "toes" if toes else "trunk"
    elif crossed.all() and way < -1:
        what = "trunk and toes"
    if what is not None:
        notes["turned"] = f"front and rear of {what} exchanged"
        points = points[:, TURNED[what]]
        _, left, _ = _offsets(points)
    points, swapped = points.copy(), []
    for name, k in (("front", 2), ("rear", 4)):
        if left[k - 2] - left[k - 1] < -SIDEWAYS:
            points[:, [k, k + 1]] = points[:, [k + 1, k]]
            swapped.append(name)
    if swapped:
        notes["swapped"] = f"left and right {' and '.join(swapped)} toes exchanged"
    return points


def _offsets(points: Array) -> tuple[Array, Array, float]:
    """Returns mean offsets of the toes (4,) ahead and to the left, and the path ahead.

    All are in trunk lengths.
    """
    points = points[all_seen(points)]
    points = points / _trunk_length(points)
    middle = points[:, :2].mean(axis=1)[:, :2]
    forward = (points[:, 0] - points[:, 1])[:, :2]
    left = np.stack((-forward[:, 1], forward[:, 0]), axis=-1)
    toes = points[:, 2:, :2] - middle[:, None]
    return (
        (toes * forward[:, None]).sum(axis=-1).mean(axis=0),
        (toes * left[:, None]).sum(axis=-1).mean(axis=0),
        float((np.diff(middle, axis=0) * forward[1:]).sum()),
    )


def _trunk_length(points: Array) -> float:
    return float(np.median(np.linalg.norm(points[:, 0] - points[:, 1], axis=-1)))


def _height(points: Array) -> float:
    """Returns the height in m of the trunk's middle when the animal is on its feet."""
    trunk = points[:, :2, 2].mean(axis=1) - np.median(_stance_heights(points))
    standing = trunk >= STANDING * np.percentile(trunk, STANDING_PERCENTILE)
    return float(np.percentile(trunk[standing], 75))


def _size(points: Array) -> float:
    """Returns the larger of the trunk's length and its height over the toes, in m."""
    return max(_trunk_length(points), _height(points))


def _stance_heights(points: Array) -> Array:
    """Returns the heights in m of the toes in stance, shape (4,)."""
    return np.percentile(points[:, 2:, 2], STANCE_PERCENTILE, axis=0)


def ground_height(points: Array) -> float:
    """Returns the height of the ground in m; 0 if it is within marker accuracy.

    Uses the lower pair of toes, since the markers of a pair may sit high on the toes.
    """
    stance = _stance_heights(points)
    ground = float(min(stance[:2].mean(), stance[2:].mean()))
    return ground if abs(ground) > GROUND * _size(points) else 0.0


def _check_level(points: Array) -> None:
    """Raises InputError if the toes in stance are on a slope."""
    toes = points[1:, 2:]
    steps = np.linalg.norm(np.diff(points[:, 2:], axis=0), axis=-1)
    stood = toes[steps <= np.percentile(steps, 25, axis=0)]
    stood = (stood - stood.mean(axis=0)) / _size(points)
    spread = np.linalg.svd(stood[:, :2], compute_uv=False)[1] / np.sqrt(len(stood))
    if spread > MIN_SPREAD:
        gradient = np.linalg.lstsq(stood[:, :2], stood[:, 2], rcond=None)[0]
        slope = np.degrees(np.arctan(np.linalg.norm(gradient)))
        if slope > MAX_SLOPE:
            raise InputError(
                f"the ground slopes by {slope:.0f} degrees, so that no axis of the "
                "file points up."
            )


def _put_on_ground(points: Array, body: Body, notes: dict[str, str]) -> Array:
    """Returns points (T, 6, 3) with the ground at z = 0.

    Shifts trunk and toes, then each marker toe by its remaining offset.
    """
    points = points.copy()
    if ground := ground_height(points):
        points[..., 2] -= ground
        notes["ground"] = f"moved from z = {ground:.3f} m to 0"
    if body.markers:
        points[:, 2:, 2] -= _stance_heights(points)
    return points


def _check_motion(recording: Recording, body: Body) -> None:
    """Raises InputError unless the motion of a recording, z up, suits its body."""
    points, fps = recording.points, recording.fps
    trunk = np.linalg.norm(points[:, 0] - points[:, 1], axis=-1) / _trunk_length(points)
    size = _size(points)
    jumps = np.zeros((len(points), 6), dtype=bool)
    departure = np.linalg.norm(np.diff(points, n=2, axis=0), axis=-1)
    jumps[2:] = departure > size * np.array([TRUNK_JUMP] * 2 + [body.jump] * 4)
    reach = np.linalg.norm(points[:, 2:] - points[:, [0, 0, 1, 1]], axis=-1)
    for reason, wrong in {
        "a point jumps (are lines missing, out of order or damaged?)": jumps,
        "the trunk changes its length": np.abs(trunk[:, None] - 1) > TRUNK_STRETCH,
        "a toe is further away than a leg is long": reach > REACH * size,
        "a toe is under the ground": points[:, 2:, 2] < -DEPTH * size,
    }.items():
        if wrong.any():
            frame = recording.first + int(np.argmax(wrong.any(axis=1)))
            raise InputError(f"at frame {frame} {reason}.")

    height = _height(points)
    unit = np.sqrt(height / GRAVITY)
    middle = points[:, :2].mean(axis=1)[:, :2]
    speed = np.median(np.linalg.norm(np.diff(middle, axis=0), axis=-1)) * fps
    period = stride_of(points, height)
    low, high = body.stride
    if speed > FASTEST * GRAVITY * unit or (
        period is not None and not low <= period / fps / unit <= high
    ):
        stride = "" if period is None else f"with strides of {period / fps:.3g} s "
        raise InputError(
            f"at {fps:g} frames/s the body would move {stride}at {speed:.3g} "
            "m/s, which is not plausible; give its true rate with --fps."
        )


def stride_of(points: Array, height: float, strides: int = 3) -> float | None:
    """Returns the stride period in frames, None if there are fewer strides."""
    spine = points[:, 0] - points[:, 1]
    track = Track(
        fps=1.0,
        trunk=points[:, :2].mean(axis=1)[:, :2],
        yaw=np.arctan2(spine[:, 1], spine[:, 0]),
        soles=points[:, 2:],
        stance_height=height,
    )
    if track.fore_aft.std(axis=0).max() < STILL * height:
        return None
    return stride_period(track, strides)
