"""Recordings of the two simulated robots made by formula, and the truth in them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.synthetic import Gait, make_steps, place, save_points

Array = NDArray[np.float64]

# Stride periods so that the MPC's swings last .15 s, and .10 and .05 s.
MPC_GAITS = {
    "trot": Gait(0.375, 0.9, 0.6, (0.5, 0.0, 0.0, 0.5)),
    "bound": Gait(0.23, 0.7, 0.08 / 0.23, (0.5, 0.5, 0.0, 0.0)),
    "crawl": Gait(0.40, 0.4, 0.75, (0.5, 0.75, 0.0, 0.25)),
    "pace": Gait(0.10, 0.6, 0.5, (0.0, 0.5, 0.0, 0.5)),
}
SOLO8_GAIT = Gait(0.6, 0.4, 0.55, (0.45, 0.95, 0.0, 0.5))
DROP_FRAMES, SETTLED = 8, 20
FOOT_RADIUS = 0.0155


@dataclass(frozen=True)
class SyntheticRobot:
    """What a recording should read as, from the origin along +x.

    Attributes:
        withers: shape (T, 3).
        hip: shape (T, 3).
        toes: shape (T, 4, 3); still and 0 high in stance.
        contacts: shape (T, 4).
    """

    withers: Array
    hip: Array
    toes: Array
    contacts: NDArray[np.bool_]


def make_robot(
    gait: Gait, time: Array, half_length: float, lateral: float, lift: float
) -> SyntheticRobot:
    """Returns a robot whose level trunk, .2 m up, moves ahead at constant speed."""
    zero, one = np.zeros_like(time), np.ones_like(time)
    middle = np.stack((gait.speed * time, zero, 0.2 * one), axis=-1)
    ahead = np.array([half_length, 0.0, 0.0])
    toes, contacts = make_steps(gait, time, (half_length, -half_length), lateral, lift)
    return SyntheticRobot(middle + ahead, middle - ahead, toes, contacts)


def write_mpc_recording(
    path: Path, gait: str, fps: float = 100.0, seconds: float = 5.0, ground: float = 0.0
) -> SyntheticRobot:
    """Writes a run that stands ``ground`` m above z = 0, .4 rad off the x axis."""
    time = np.arange(round(seconds * fps)) / fps
    robot = make_robot(MPC_GAITS[gait], time, 0.1505, 0.1, 0.062)
    points = _points(robot, 0.044, feet_first=True)
    save_points(path, place(points + np.array([0.0, 0.0, ground]), 0.4))
    return robot


def write_solo8_recording(
    path: Path, frames: int = 120, drop: bool = True
) -> SyntheticRobot:
    """Writes a run that begins with a drop; the truth has all frames, also those."""
    time = (np.arange(frames) - SETTLED * drop) / 50.0
    robot = make_robot(SOLO8_GAIT, time, 0.19, 0.15, 0.05)
    points = _points(robot, 0.104, feet_first=False)
    points[:, 5:, 2] += FOOT_RADIUS
    if drop:
        fall = np.arange(DROP_FRAMES) / DROP_FRAMES
        points[:DROP_FRAMES, :, 2] += (0.14 * (1 - fall**2))[:, None]
    save_points(path, place(points, -0.2))
    return robot


def _points(robot: SyntheticRobot, half_width: float, *, feet_first: bool) -> Array:
    """Returns the nine points, shape (T, 9, 3), in the order of the MPC or of Solo8."""
    left = np.array([0.0, half_width, 0.0])
    ends = (robot.withers, robot.withers, robot.hip, robot.hip)
    sides = (left, -left, left, -left)
    hips = np.stack([end + side for end, side in zip(ends, sides, strict=True)], axis=1)
    centre = (robot.withers + robot.hip)[:, None] / 2
    parts = (robot.toes, centre, hips) if feet_first else (centre, hips, robot.toes)
    return np.concatenate(parts, axis=1)
