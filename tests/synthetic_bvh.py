"""A BVH file of the dog made by formula, in which every joint has a position."""

from pathlib import Path

import numpy as np

from tests.synthetic import SyntheticDog, dog_points, make_dog

# Chains of the skeleton: the joint they hang on, and their own.
CHAINS = (
    (None, ("Hips", "Spine", "Spine1", "Neck", "Head")),
    ("Spine1", ("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand")),
    ("Spine1", ("RightShoulder", "RightArm", "RightForeArm", "RightHand")),
    ("Hips", ("LeftUpLeg", "LeftLeg", "LeftFoot")),
    ("Hips", ("RightUpLeg", "RightLeg", "RightFoot")),
    ("Hips", ("Tail", "Tail1")),
)
END_OFFSET = np.array([0.0, -7.0, 2.0])
CHANNELS = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"


def write_dog_bvh(
    path: Path, gait: str = "pace", seconds: float = 4.0, heading: float = 0.7
) -> SyntheticDog:
    """Writes a BVH file (cm, Y up) and returns its truth.

    The root is turned by ``heading`` rad; all other joints are placed in its frame, 7
    cm over an end site where their chain ends.
    """
    dog = make_dog(gait, seconds)
    points = 100 * dog_points(dog)[..., [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
    children: dict[str | None, list[str]] = {}
    parents: dict[str, str | None] = {}
    ends, index = set(), {}
    for base, chain in CHAINS:
        ends.add(chain[-1])
        for parent, name in zip((base, *chain), chain, strict=False):
            index[name] = len(index) + len(ends) - 1
            parents[name] = parent
            children.setdefault(parent, []).append(name)
    lines: list[str] = ["HIERARCHY"]
    places: dict[str, np.ndarray] = {}
    columns: list[np.ndarray] = []

    def add(name: str, depth: int) -> None:
        kind = "ROOT" if depth == 0 else "JOINT"
        pad = "  " * depth
        lines.append(f"{pad}{kind} {name}")
        lines.extend((f"{pad}{{", f"{pad}  OFFSET 1 2 3"))
        lines.append(f"{pad}  CHANNELS 6 {CHANNELS}")
        parent = parents[name]
        if name in ends:
            places[name] = points[:, index[name] + 1] - END_OFFSET
        else:
            places[name] = points[:, index[name]]
        shift = places[name] - (0 if parent is None else places[parent])
        angles = np.zeros_like(shift)
        if parent is None:
            c, s = np.cos(heading), np.sin(heading)
            turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
            shift = shift @ turn.T
            angles[:, 2] = np.degrees(heading)
        columns.extend((shift, angles))
        for child in children.get(name, []):
            add(child, depth + 1)
        if name in ends:
            x, y, z = END_OFFSET
            lines.extend((f"{pad}  End Site", f"{pad}  {{"))
            lines.extend((f"{pad}    OFFSET {x} {y} {z}", f"{pad}  }}"))
        lines.append(f"{pad}}}")

    add("Hips", 0)
    rows = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames:\t{len(rows)}", "Frame Time:\t0.0166667"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode())
    return dog
