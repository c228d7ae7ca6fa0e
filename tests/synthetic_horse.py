"""Recordings of a horse on a treadmill made by formula, and the truth in them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.synthetic import Gait, make_steps, save_points

Array = NDArray[np.float64]

HEIGHT, TRUNK, LATERAL, LIFT = 1.3, 0.74, 0.14, 0.1
# Constant errors of the hooves' markers in height, m.
MARKER_HEIGHTS = np.array([0.012, -0.003, -0.025, 0.004])
# The trunk's speed varies by this, m/s, twice a stride.
SURGE = 0.15

GAITS = {
    "walk": Gait(1.05, 1.55, 0.6, (0.25, 0.75, 0.0, 0.5)),
    "trot": Gait(0.66, 2.9, 0.4, (0.5, 0.0, 0.0, 0.5)),
}


@dataclass(frozen=True)
class SyntheticHorse:
    """What a recording should read as: over the ground, from the origin along +x.

    Attributes:
        withers: shape (T, 3).
        hip: shape (T, 3).
        toes: shape (T, 4, 3); still and 0 high in stance.
        contacts: shape (T, 4).
        gait: what it was made of.
        fps: frames per second.
    """

    withers: Array
    hip: Array
    toes: Array
    contacts: NDArray[np.bool_]
    gait: Gait
    fps: float


def make_horse(gait: str, fps: float, seconds: float = 6.0) -> SyntheticHorse:
    """Returns a horse that goes straight ahead, its trunk surging twice a stride."""
    made = GAITS[gait]
    time = np.arange(round(seconds * fps)) / fps
    frequency = 4 * np.pi / made.period
    middle = made.speed * time + SURGE / frequency * np.sin(frequency * time)
    zero, one = np.zeros_like(time), np.ones_like(time)
    withers = np.stack((middle + TRUNK / 2, zero, HEIGHT * one), axis=-1)
    hip = np.stack((middle - TRUNK / 2, zero, HEIGHT * one), axis=-1)
    toes, contacts = make_steps(made, time, (0.7, -0.3), LATERAL, LIFT)
    return SyntheticHorse(withers, hip, toes, contacts, made, fps)


def markers(horse: SyntheticHorse, swapped: tuple[int, ...] = ()) -> Array:
    """Returns the seven markers over the ground, shape (T, 7, 3).

    Args:
        horse: whose.
        swapped: 0 and 1 for the front and the rear pair: left and right exchanged.
    """
    head = horse.withers + np.array([1.1, 0.0, 0.2])
    raised = horse.toes + MARKER_HEIGHTS[:, None] * np.array([0.0, 0.0, 1.0])
    for pair in swapped:
        raised[:, [2 * pair, 2 * pair + 1]] = raised[:, [2 * pair + 1, 2 * pair]]
    points = np.stack((head, horse.withers, horse.hip), axis=1)
    return np.concatenate((points, raised), axis=1)


def write_world_recording(
    path: Path, horse: SyntheticHorse, swapped: tuple[int, ...] = ()
) -> None:
    """Writes 21 columns in metres whose trunk follows a poor estimate of the belt."""
    points = markers(horse, swapped)
    time = np.arange(len(points)) / horse.fps
    estimate = 0.96 * horse.gait.speed * time + 0.02 * np.sin(7 * time)
    points[..., 0] += (estimate - horse.withers[:, 0])[:, None]
    save_points(path, points)


def write_raw_recording(
    path: Path,
    horse: SyntheticHorse,
    swapped: tuple[int, ...] = (),
    gaps: tuple[tuple[int, int, int], ...] = (),
) -> None:
    """Writes the raw form: header, frame, time, mm, in the treadmill's frame.

    Args:
        path: the file.
        horse: whose.
        swapped: as in :func:`markers`.
        gaps: (marker, first frame, frame after the last) that were not seen.
    """
    points = markers(horse, swapped)
    time = np.arange(len(points)) / horse.fps
    points[..., 0] -= (horse.gait.speed * time)[:, None]
    names = ("Head", "Withers", "Sacrum", "HFL", "HFR", "HHL", "HHR")
    header = ["Frame#", "Time", *(f"{name}{axis}" for name in names for axis in "XYZ")]
    fields = [[f"{v:.5f}" for v in row] for row in 1000 * points.reshape(-1, 21)]
    for marker, start, end in gaps:
        for k in range(start, end):
            fields[k][3 * marker : 3 * marker + 3] = ["", "NaN", ""]
    lines = [",".join(f'"{name}"' for name in header)]
    for k, row in enumerate(fields):
        lines.append(f"{k + 1},{time[k]:.3f}," + ",".join(row))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
