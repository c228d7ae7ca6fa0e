"""Measures axes, sides, order of quaternions and ground of human motion.

As of four-legged sources (:mod:`.conventions`), what the file says is not trusted: a
trunk is above its feet, toes are ahead of heels, left of right is where that says,
knees bend backward only, and one foot stands still, on the ground.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_conjugate
from loco_drake.datasets.conventions import UPRIGHT, with_z_up
from loco_drake.datasets.human_file import Capture
from loco_drake.motion.biped_clip import BipedClip

_Parts = tuple[Array, Array, Array]  # spine, legs and arms

_XYZW = [3, 0, 1, 2]
UP = 1  # the axis that the format says is up
# Another reading is better if the slower foot moves at less than this of its speed, and
# by more than rounding, m/s.
_CLEARLY, _SLOW = 0.5, 0.05
# In the files known here of people on their feet, the lowest end of the soles is within
# .06 of the legs' length in a tenth of the frames; a unit that is off by a tenth would
# put it off by more.
_GROUND, _PERCENTILE = 0.08, 10.0
_SIDES = 0.1  # least cosine between where left is, and where it should be
_JUMP = 1.5  # m that a point may move from a straight line within a frame


def other_readings(capture: Capture) -> dict[str, Capture]:
    """Returns a capture with its quaternions read in other ways, by what these are."""
    # Knees and elbows have angles.
    q = {
        k: v for k, v in capture.rotations.items() if not k.endswith(("knee", "elbow"))
    }
    others = {
        "x, y, z, w": {name: value[:, _XYZW] for name, value in q.items()},
        "inverse": {name: quat_conjugate(value) for name, value in q.items()},
    }
    return {
        how: replace(capture, rotations={**capture.rotations, **other})
        for how, other in others.items()
    }


def check_reading(
    capture: Capture, read: Callable[[Capture], Mapping[str, Array]]
) -> None:
    """Raises InputError if feet stand better with rotations read in another way.

    Args:
        capture: the file's content.
        read: returns the points of a body by name, (T, 3) each.
    """
    slip = _sole_speed(read(capture), capture.time)
    for how, reading in other_readings(capture).items():
        other = _sole_speed(read(reading), capture.time)
        if other < _CLEARLY * slip - _SLOW:
            raise InputError(
                f"its slower foot moves at {slip:.2g} m/s, but at {other:.2g} m/s if "
                f"its quaternions are {how}."
            )


def settle(clip: BipedClip) -> BipedClip:
    """Returns a clip with z up, on the ground, that starts at the origin along +x.

    Raises:
        InputError: if that cannot be told, or the body would not be one.
    """
    notes = dict(clip.provenance)
    axis, upward = _up_axis(clip)
    if (axis, upward) != (UP, True):
        notes["up"] = "turned upright, since another axis than the format's points up"
    parts = (
        with_z_up(clip.spine, axis, upward),
        with_z_up(clip.legs, axis, upward),
        with_z_up(clip.arms, axis, upward),
    )
    parts = _name_sides(parts, notes)
    parts = _put_on_ground(parts, notes, abs(_upward(clip)[axis]) >= UPRIGHT)
    spine, legs, arms = parts
    clip = replace(clip, spine=spine, legs=legs, arms=arms, provenance=notes)
    _check_body(clip)
    x, y = clip.forward[0, :2]
    R = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    origin = clip.middle[0] * np.array([1.0, 1.0, 0.0])
    spine, legs, arms = ((part - origin) @ R for part in parts)
    return replace(clip, spine=spine, legs=legs, arms=arms)


def _up_axis(clip: BipedClip) -> tuple[int, bool]:
    """Returns the axis along which the trunk is above the feet, and whether upward.

    Somebody who lies or crawls tells none: then it is the format's, if that is no
    further off than any.
    """
    cosines = _upward(clip)
    axis = int(np.abs(cosines).argmax())
    upright = abs(cosines[axis]) >= UPRIGHT
    if upright and _is_ground(clip, axis, cosines[axis] > 0):
        return axis, bool(cosines[axis] > 0)
    if _is_ground(clip, UP, True):
        return UP, True
    raise InputError(
        "its feet are not on the ground, at 0 along the axis that points up: it does "
        "not stand, or its skeleton is of another size."
    )


def _upward(clip: BipedClip) -> Array:
    """Returns the unit vector from the feet to the trunk, shape (3,)."""
    trunk = clip.spine[:, 1:].mean(axis=1)
    up = np.median(trunk - clip.toes.mean(axis=1), axis=0)
    if not np.linalg.norm(up) > 0:
        raise InputError("the body has no height.")
    return np.asarray(up / np.linalg.norm(up), dtype=np.float64)


def _is_ground(clip: BipedClip, axis: int, upward: bool) -> bool:
    """Returns whether the lowest soles are near 0 along an axis."""
    ground = _ground(with_z_up(clip.legs, axis, upward))
    return abs(ground) <= _GROUND * _leg_length(clip.legs)


def _ground(legs: Array) -> float:
    """Returns the height of the ground, m."""
    lowest = legs[:, :, 3:, 2].min(axis=(1, 2))
    return float(np.percentile(lowest, _PERCENTILE))


def _name_sides(parts: _Parts, notes: dict[str, str]) -> _Parts:
    """Returns spine, legs and arms with left and right exchanged where they are."""
    spine, legs, arms = parts
    up = spine[:, 2] - spine[:, 0]
    ahead = (legs[:, :, 4] - legs[:, :, 3]).sum(axis=1)
    left = legs[:, 0, 0] - legs[:, 1, 0]
    product = (np.cross(up, ahead) * left).sum(axis=-1)
    sizes = [np.linalg.norm(v, axis=-1) for v in (up, ahead, left)]
    cosine = float(np.median(product / np.maximum(np.prod(sizes, axis=0), 1e-12)))
    if abs(cosine) < _SIDES:
        raise InputError("where left is cannot be told from its feet and hips.")
    if cosine > 0:
        return parts
    notes["swapped"] = "left and right exchanged"
    return spine, legs[:, ::-1], arms[:, ::-1]


def _put_on_ground(parts: _Parts, notes: dict[str, str], upright: bool) -> _Parts:
    """Returns spine, legs and arms with the ground at z = 0.

    Only of a body that is ``upright`` do the feet tell exactly where that is.
    """
    if not upright:
        return parts
    ground = _ground(parts[1])
    notes["ground"] = f"moved from z = {ground:.3f} m to 0"
    origin = np.array([0.0, 0.0, ground])
    spine, legs, arms = parts
    return spine - origin, legs - origin, arms - origin


def _check_body(clip: BipedClip) -> None:
    """Raises InputError if knees bend forward, or a point jumps."""
    hip, knee, ankle, heel, toe = np.moveaxis(clip.legs, 2, 0)
    bend = ((knee - (hip + ankle) / 2) * (toe - heel)).sum(axis=-1)
    if np.median(bend) < 0:
        raise InputError("its knees bend forward, so its toes are where heels are.")
    points = np.concatenate((clip.legs.reshape(len(clip), -1, 3), clip.spine), axis=1)
    jumps = np.linalg.norm(np.diff(points, n=2, axis=0), axis=-1).max(axis=-1)
    if jumps.max() > _JUMP * _leg_length(clip.legs):
        raise InputError(f"at frame {int(jumps.argmax()) + 1} a point jumps.")


def _leg_length(legs: Array) -> float:
    """Returns the length from hip to knee to ankle, m."""
    bones = np.linalg.norm(np.diff(legs[:, :, :3], axis=2), axis=-1)
    return float(np.median(bones.sum(axis=-1)))


def _sole_speed(points: Mapping[str, Array], time: Array) -> float:
    """Returns the median speed of that end of the feet that is slowest, m/s."""
    ends = [f"{side}_{end}" for side in ("left", "right") for end in ("heel", "toe")]
    soles = np.stack([points[name] for name in ends], axis=1)
    speeds = np.linalg.norm(np.diff(soles, axis=0), axis=-1) / np.diff(time)[:, None]
    return float(np.median(speeds.min(axis=1)))
