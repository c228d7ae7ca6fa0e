"""BVH files of animals made by formula, whose joints turn, and the truth in them.

Two skeletons that have nothing in common with the dog's but four legs: a cat in metres
with Z up, and a horse in inches with Y up, another root and order of joints.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

WALK = (0.25, 0.75, 0.0, 0.5)  # lateral sequence: RL, FL, RR, FR
TROT = (0.5, 1.0, 0.0, 0.5)
STAND = None
CHANGE = 0.8


@dataclass(frozen=True)
class Gait:
    """Speed m/s, stride period s, duty factor, touchdowns behind RL in strides."""

    speed: float
    period: float
    duty: float
    lags: tuple[float, float, float, float]


@dataclass(frozen=True)
class Animal:
    """A body and how its file is written; lengths in m, nodes parents first."""

    height: float  # of the trunk, which is level
    trunk: float  # from hip to withers
    width: float  # of the legs from the midline
    lift: float  # of the toes in swing
    gait: Gait
    names: dict[str, str]  # of the joints, by what they are
    tree: tuple[tuple[str, str], ...]  # joint and parent, in the order of the file
    unit: float  # m in the file's unit
    R_FW: Array  # from z up, x forward to the axes of the file
    channels: str  # of rotations, such as ZXY
    fps: float
    named_ends: bool  # whether toes are joints, or the ends of chains


def _legs(front: str, rear: str, order: tuple[str, ...]) -> list[tuple[str, str]]:
    return [
        pair
        for leg in order
        for pair in (
            (f"{leg}_top", front if leg[0] == "F" else rear),
            (f"{leg}_knee", f"{leg}_top"),
            (f"{leg}_toe", f"{leg}_knee"),
        )
    ]


CAT = Animal(
    height=0.26,
    trunk=0.27,
    width=0.045,
    lift=0.04,
    gait=Gait(0.65, 0.6, 0.62, WALK),
    names={
        "hip": "Pelvis",
        "withers": "Chest",
        "head": "Skull",
        "tail": "Tail",
        "FL_top": "Humerus.L",
        "FL_knee": "Radius.L",
        "FL_toe": "Paw_Fore.L",
        "FR_top": "Humerus.R",
        "FR_knee": "Radius.R",
        "FR_toe": "Paw_Fore.R",
        "RL_top": "Femur.L",
        "RL_knee": "Tibia.L",
        "RL_toe": "Paw_Hind.L",
        "RR_top": "Femur.R",
        "RR_knee": "Tibia.R",
        "RR_toe": "Paw_Hind.R",
    },
    tree=(
        ("hip", ""),
        ("tail", "hip"),
        *_legs("withers", "hip", ("RL", "RR")),
        ("withers", "hip"),
        ("head", "withers"),
        *_legs("withers", "hip", ("FL", "FR")),
    ),
    unit=1.0,
    R_FW=np.eye(3),
    channels="ZXY",
    fps=100.0,
    named_ends=True,
)
HORSE = Animal(
    height=1.45,
    trunk=0.95,
    width=0.16,
    lift=0.14,
    gait=Gait(3.2, 0.72, 0.45, TROT),
    names={
        "hip": "Croup",
        "withers": "Base",
        "head": "Poll",
        "tail": "Dock",
        **{
            f"{leg}_{part}": f"{side}{end}{bone}"
            for leg, side, end in (
                ("FL", "Near", "Fore"),
                ("FR", "Off", "Fore"),
                ("RL", "Near", "Hind"),
                ("RR", "Off", "Hind"),
            )
            for part, bone in (("top", "Arm"), ("knee", "Cannon"))
        },
    },
    tree=(
        ("withers", ""),
        *_legs("withers", "hip", ("FR", "FL")),
        ("hip", "withers"),
        *_legs("withers", "hip", ("RR", "RL")),
        ("tail", "hip"),
        ("head", "withers"),
    ),
    unit=0.0254,
    R_FW=np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    channels="YZX",
    fps=60.0,
    named_ends=False,
)


# The file that docs/own_animal.md walks through.
EXAMPLE = replace(CAT, fps=50.0)
FAST = Gait(1.1, 0.42, 0.45, TROT)
SCHEDULE = ((0.0, STAND), (1.6, CAT.gait), (4.6, FAST))


@dataclass(frozen=True)
class Truth:
    """What a file should read as, in m, z up, along +x."""

    withers: Array  # shape (T, 3)
    hip: Array  # shape (T, 3)
    toes: Array  # shape (T, 4, 3)


def make_motion(
    animal: Animal,
    seconds: float = 4.0,
    schedule: tuple[tuple[float, Gait | None], ...] = (),
) -> Truth:
    """Returns the motion of an animal straight ahead.

    Args:
        animal: the animal.
        seconds: how long.
        schedule: start time in s and gait of each part, STAND for standing; changes
            take CHANGE s around their time. Without it, the animal's gait.
    """
    time = np.arange(round(seconds * animal.fps) + 1) / animal.fps
    parts = schedule or ((0.0, animal.gait),)
    moving = [gait for _, gait in parts if gait is not None]
    starts = np.array([start for start, _ in parts])
    # While it stands, the timing is that of what follows, and the clock stops.
    gaits = [gait or moving[0] for _, gait in parts]
    on = [float(gait is not None) for _, gait in parts]

    def over(values: list[float]) -> Array:
        at = np.stack((starts - CHANGE / 2, starts + CHANGE / 2), -1).ravel()[1:]
        return np.interp(time, at, np.repeat(values, 2)[:-1])

    go = over(on)
    clock = np.cumsum(go * over([1 / g.period for g in gaits])) / animal.fps
    path = np.cumsum(go * over([g.speed for g in gaits])) / animal.fps
    duty = over([g.duty for g in gaits])
    toes = np.empty((len(time), 4, 3))
    for leg in range(4):
        phase = clock - over([g.lags[leg] for g in gaits])
        stride, share = np.divmod(phase, 1.0)

        def foothold(n: Array, phase: Array = phase) -> Array:
            """Where the trunk is in the middle of a contact."""
            rising = phase + 1e-9 * np.arange(len(phase))
            slope = animal.gait.speed * animal.gait.period
            middle = n + np.interp(n, rising, duty) / 2
            before = np.minimum(middle - rising[0], 0) + np.maximum(
                middle - rising[-1], 0
            )
            return np.interp(middle, rising, path) + slope * before

        s = np.clip((share - duty) / (1 - duty), 0.0, 1.0)
        advance = s**3 * (10 - 15 * s + 6 * s**2)
        here, there = foothold(stride), foothold(stride + 1)
        side, ahead = (1, -1)[leg % 2], (0.5, -0.5)[leg // 2]
        toes[:, leg, 0] = here + advance * (there - here) + ahead * animal.trunk
        toes[:, leg, 1] = side * animal.width
        toes[:, leg, 2] = 64 * animal.lift * go * (s * (1 - s)) ** 3
    ones = np.ones_like(time)
    middle = np.stack((path, 0 * ones, animal.height * ones), axis=-1)
    half = np.array([animal.trunk / 2, 0, 0])
    return Truth(middle + half, middle - half, toes)


def write_bvh(
    path: Path,
    animal: Animal,
    seconds: float = 4.0,
    heading: float = 0.0,
    schedule: tuple[tuple[float, Gait | None], ...] = (),
) -> Truth:
    """Writes the BVH file of an animal that heads that way, rad; returns its truth."""
    truth = make_motion(animal, seconds, schedule)
    count = len(truth.hip)
    turn = Rotation.from_euler("z", heading)
    drop = 0.2 * animal.height
    offsets = {
        "withers": np.array([animal.trunk, 0, 0]),
        "hip": np.array([-animal.trunk, 0, 0]),
        "head": np.array([0.5, 0, 0.3]) * animal.trunk,
        "tail": np.array([-0.4, 0, 0.1]) * animal.trunk,
    }
    turns = {name: Rotation.concatenate([turn] * count) for name in offsets}
    reach = animal.height - drop
    link = 0.66 * reach
    for leg, name in enumerate(("FL", "FR", "RL", "RR")):
        base = truth.withers if leg < 2 else truth.hip
        side = (1, -1)[leg % 2]
        offsets[f"{name}_top"] = np.array([0, side * animal.width, -drop])
        offsets[f"{name}_knee"] = offsets[f"{name}_toe"] = np.array([0, 0, -link])
        x, _, z = (truth.toes[:, leg] - base - offsets[f"{name}_top"]).T
        length = np.hypot(x, z)
        assert (length < 2 * link).all(), "a toe is out of reach"
        bend = (1, -1)[leg // 2] * np.arccos(length / (2 * link))
        aim = np.arctan2(-x, -z)  # pitch that turns down toward the toe
        upper, lower = aim + bend, aim - bend
        turns[f"{name}_top"] = turn * Rotation.from_euler("y", upper[:, None])
        turns[f"{name}_knee"] = turn * Rotation.from_euler("y", lower[:, None])
        turns[f"{name}_toe"] = turns[f"{name}_knee"]
    root = animal.tree[0][0]
    base = truth.hip if root == "hip" else truth.withers
    position = turn.apply(base) @ animal.R_FW.T / animal.unit
    text = _hierarchy(animal, offsets)
    columns = [position]
    parents = dict(animal.tree)
    for node in _joints(animal):
        parent = parents[node]
        relative = turns[parent].inv() * turns[node] if parent else turns[node]
        R = animal.R_FW @ relative.as_matrix() @ animal.R_FW.T
        columns.append(Rotation.from_matrix(R).as_euler(animal.channels, degrees=True))
    rows = np.concatenate(columns, axis=1)
    text += ["MOTION", f"Frames: {count}", f"Frame Time: {1 / animal.fps:.6f}"]
    # To .01 mm of a metre, and to a thousandth of a degree.
    rows[:, :3], rows[:, 3:] = rows[:, :3].round(5), rows[:, 3:].round(3)
    text += [" ".join(f"{value + 0.0:.8g}" for value in row) for row in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(text) + "\n")
    return truth


def _joints(animal: Animal) -> list[str]:
    """Returns the joints depth first, as BVH orders channels."""
    children: dict[str, list[str]] = {}
    for node, parent in animal.tree:
        children.setdefault(parent, []).append(node)
    order: list[str] = []

    def visit(node: str) -> None:
        if node.endswith("_toe") and not animal.named_ends:
            return
        order.append(node)
        for child in children.get(node, []):
            visit(child)

    visit(animal.tree[0][0])
    return order


def _hierarchy(animal: Animal, offsets: dict[str, Array]) -> list[str]:
    children: dict[str, list[str]] = {}
    for node, parent in animal.tree:
        children.setdefault(parent, []).append(node)
    lines = ["HIERARCHY"]

    def offset(node: str) -> str:
        x, y, z = animal.R_FW @ offsets[node] / animal.unit
        return f"OFFSET {x:.6f} {y:.6f} {z:.6f}"

    def visit(node: str, depth: int) -> None:
        pad = "  " * depth
        if node.endswith("_toe") and not animal.named_ends:
            lines.extend((f"{pad}End Site", f"{pad}{{", f"{pad}  {offset(node)}"))
            lines.append(f"{pad}}}")
            return
        spin = " ".join(f"{axis}rotation" for axis in animal.channels)
        root = depth == 0
        place = "OFFSET 0 0 0" if root else offset(node)
        channels = f"6 Xposition Yposition Zposition {spin}" if root else f"3 {spin}"
        lines.append(f"{pad}{'ROOT' if root else 'JOINT'} {animal.names[node]}")
        lines.extend((f"{pad}{{", f"{pad}  {place}", f"{pad}  CHANNELS {channels}"))
        for child in children.get(node, []):
            visit(child, depth + 1)
        if not children.get(node):
            # As exporters write it: the end of a chain is where its joint is.
            lines.extend((f"{pad}  End Site", f"{pad}  {{"))
            lines.extend((f"{pad}    OFFSET 0 0 0", f"{pad}  }}"))
        lines.append(f"{pad}}}")

    visit(animal.tree[0][0], 0)
    return lines
