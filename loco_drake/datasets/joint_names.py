"""What names of joints tell: left or right, front or rear."""

import re

from loco_drake.datasets.named_points import NamedPoints

_SIDES = {
    "left": {"left", "l", "lft", "fl", "lf", "rl", "hl", "lh", "bl", "lb"},
    "right": {"right", "r", "rgt", "fr", "rf", "rr", "hr", "rh", "br", "rb"},
}
_FRONT = {"front", "fore", "f", "fl", "fr", "lf", "rf", "hand", "arm", "forearm"}
_REAR = {"rear", "hind", "back", "h", "b", "rl", "rr", "hl", "hr", "lh", "rh"}
_ENDS = {
    "front": _FRONT | {"shoulder", "humerus", "radius", "wrist", "scapula", "elbow"},
    "rear": _REAR | {"bl", "br", "lb", "rb", "femur", "thigh", "hip", "tibia", "knee"},
}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def side_of(named: NamedPoints, index: int) -> str | None:
    """Returns left or right by the name of a point or of those above it, or None."""
    return _told(named, index, _SIDES)


def end_of(named: NamedPoints, index: int) -> str | None:
    """Returns front or rear by the name of a point or of those above it, or None."""
    return _told(named, index, _ENDS)


def _told(named: NamedPoints, index: int, words: dict[str, set[str]]) -> str | None:
    for joint in (index, *named.ancestors(index)):
        found = {word.lower() for word in _WORD.findall(named.names[joint])}
        told = [what for what, those in words.items() if found & those]
        if len(told) == 1:
            return told[0]
    return None
