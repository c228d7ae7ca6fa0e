"""Recordings made by formula, in the format of real ones, and the truth in them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FPS = 60.0
HIP_HEIGHT, WITHERS_HEIGHT, TRUNK = 0.46, 0.42, 0.41
STANCE_HEIGHT = (HIP_HEIGHT + WITHERS_HEIGHT) / 2
LATERAL = 0.03
SWING_HEIGHT = 0.08
# Heights at which the markers of standing toes are recorded.
MARKER_HEIGHTS = np.array([0.02, 0.021, 0.004, -0.002])


@dataclass(frozen=True)
class Gait:
    """Stride period s, speed m/s, duty factor, touchdown behind RL in strides."""

    period: float
    speed: float
    duty: float
    phase: tuple[float, float, float, float]


GAITS = {
    "pace": Gait(0.65, 1.0, 0.55, (0.0, 0.5, 0.0, 0.5)),
    "trot": Gait(0.48, 1.8, 0.42, (0.5, 0.0, 0.0, 0.5)),
    "gallop": Gait(0.44, 2.8, 0.28, (0.12, 0.3, 0.0, 0.86)),
}


@dataclass(frozen=True)
class SyntheticDog:
    """What a recording should read as: Z up, starting at the origin along +x, 60 Hz.

    Attributes:
        withers: shape (T, 3).
        hip: shape (T, 3).
        toes: shape (T, 4, 3); 0 high in stance, where they do not move.
        contacts: shape (T, 4).
        gait: what it was made of.
    """

    withers: Array
    hip: Array
    toes: Array
    contacts: NDArray[np.bool_]
    gait: Gait


def make_dog(gait: str = "pace", seconds: float = 4.0) -> SyntheticDog:
    """Returns a dog that runs straight ahead at constant speed."""
    made = GAITS[gait]
    time = np.arange(round(seconds * FPS)) / FPS
    middle = made.speed * time
    half = np.sqrt(TRUNK**2 - (HIP_HEIGHT - WITHERS_HEIGHT) ** 2) / 2
    zero, one = np.zeros_like(time), np.ones_like(time)
    withers = np.stack((middle + half, zero, WITHERS_HEIGHT * one), axis=-1)
    hip = np.stack((middle - half, zero, HIP_HEIGHT * one), axis=-1)
    toes = np.empty((len(time), 4, 3))
    contacts = np.empty((len(time), 4), dtype=bool)
    for leg, lag in enumerate(made.phase):
        ahead = half if leg < 2 else -half - 0.03
        stride, phase = np.divmod(time / made.period - lag, 1.0)
        contacts[:, leg] = phase < made.duty
        # A foot stands where its trunk point passes half a contact after touchdown.
        touchdown = (stride + lag) * made.period
        stands = made.speed * (touchdown + made.duty * made.period / 2) + ahead
        s = np.clip((phase - made.duty) / (1 - made.duty), 0.0, 1.0)
        advance = s**3 * (10 - 15 * s + 6 * s**2)
        toes[:, leg, 0] = stands + advance * made.speed * made.period
        toes[:, leg, 1] = LATERAL if leg % 2 == 0 else -LATERAL
        toes[:, leg, 2] = 64 * SWING_HEIGHT * (s * (1 - s)) ** 3
    return SyntheticDog(withers, hip, toes, contacts, made)


def write_dog_recording(
    path: Path, gait: str = "pace", seconds: float = 4.0, heading: float = 0.7
) -> SyntheticDog:
    """Writes a dog keypoint file (81 columns, Y up, 60 Hz), and returns its truth.

    Args:
        path: the file to write.
        gait: one of GAITS.
        seconds: its length.
        heading: direction of the run in the file, rad; the start is off the origin too.
    """
    dog = make_dog(gait, seconds)
    points = np.empty((len(dog.hip), 27, 3))
    points[:, :3] = dog.hip[:, None]
    points[:, 3:10] = points[:, 11:15] = points[:, 24:27] = dog.withers[:, None]
    points[:, 16:19] = points[:, 20:23] = dog.hip[:, None]
    raised = dog.toes + MARKER_HEIGHTS[:, None] * np.array([0.0, 0.0, 1.0])
    points[:, [10, 15, 19, 23]] = raised
    c, s = np.cos(heading), np.sin(heading)
    x = c * points[..., 0] - s * points[..., 1] + 1.5
    y = s * points[..., 0] + c * points[..., 1] - 0.5
    y_up = np.stack((x, points[..., 2], -y), axis=-1)
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, y_up.reshape(len(y_up), 81), fmt="%.6f", delimiter=",")
    return dog


def write_data_folder(
    folder: Path, gaits: tuple[str, ...] = ("pace", "trot"), seconds: float = 4.0
) -> Path:
    """Writes a data folder with one recording of each gait and its segments.csv."""
    rows = ["dataset,file,gait,start_frame,end_frame,fps,mean_speed_mps,notes"]
    for gait in gaits:
        file = f"keypoints/made_{gait}.txt"
        write_dog_recording(folder / "dog_mann" / file, gait, seconds)
        end, speed = round(seconds * FPS), GAITS[gait].speed
        rows.append(f'dog_mann,{file},{gait},0,{end},60,{speed},"made, not measured"')
    (folder / "segments.csv").write_text("\n".join(rows) + "\n")
    return folder
