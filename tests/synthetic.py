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
    toes, contacts = make_steps(made, time, (half, -half - 0.03), LATERAL, SWING_HEIGHT)
    return SyntheticDog(withers, hip, toes, contacts, made)


def make_steps(
    gait: Gait, time: Array, ahead: tuple[float, float], lateral: float, lift: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Returns toes (T, 4, 3) of an animal at constant speed, and their contacts.

    Args:
        gait: how it steps; its middle is at x = speed * time.
        time: s, shape (T,).
        ahead: x of front and rear toes in mid-stance from that middle, m.
        lateral: distance of the toes from the midline, m.
        lift: height of the toes in mid-swing, m; 0 in stance.
    """
    toes = np.empty((len(time), 4, 3))
    contacts = np.empty((len(time), 4), dtype=bool)
    for leg, lag in enumerate(gait.phase):
        stride, phase = np.divmod(time / gait.period - lag, 1.0)
        contacts[:, leg] = phase < gait.duty
        # A foot stands where its trunk point passes half a contact after touchdown.
        touchdown = (stride + lag) * gait.period
        middle = touchdown + gait.duty * gait.period / 2
        s = np.clip((phase - gait.duty) / (1 - gait.duty), 0.0, 1.0)
        advance = s**3 * (10 - 15 * s + 6 * s**2)
        stands = gait.speed * middle + ahead[leg // 2]
        toes[:, leg, 0] = stands + advance * gait.speed * gait.period
        toes[:, leg, 1] = lateral if leg % 2 == 0 else -lateral
        toes[:, leg, 2] = 64 * lift * (s * (1 - s)) ** 3
    return toes, contacts


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
    x, y, z = np.moveaxis(place(dog_points(dog), heading), -1, 0)
    save_points(path, np.stack((x, z, -y), axis=-1))
    return dog


def write_lying_dog(path: Path, gait: str = "trot") -> None:
    """Writes a dog that lies for 200 frames, rises for 40 and then runs for 4 s."""
    write_dog_recording(path, gait)
    runs = np.loadtxt(path, delimiter=",").reshape(-1, 27, 3)
    drop = np.concatenate((np.ones(200), np.linspace(1, 0, 40)))[:, None]
    lies = np.repeat(runs[:1], 240, axis=0)
    lies[..., 1] -= 0.34 * drop * (lies[..., 1] > 0.35)
    save_points(path, np.concatenate((lies, runs)))


def dog_points(dog: SyntheticDog) -> Array:
    """Returns the 27 points of the skeleton, Z up, shape (T, 27, 3)."""
    points = np.empty((len(dog.hip), 27, 3))
    points[:, :3] = dog.hip[:, None]
    points[:, 3:10] = points[:, 11:15] = points[:, 24:27] = dog.withers[:, None]
    points[:, 16:19] = points[:, 20:23] = dog.hip[:, None]
    raised = dog.toes + MARKER_HEIGHTS[:, None] * np.array([0.0, 0.0, 1.0])
    points[:, [10, 15, 19, 23]] = raised
    return points


def place(points: Array, heading: float) -> Array:
    """Returns points (..., 3) turned by ``heading`` rad and moved off the origin."""
    c, s = np.cos(heading), np.sin(heading)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return points @ R.T + np.array([1.5, -0.5, 0.0])


def save_points(path: Path, points: Array) -> None:
    """Writes points (T, N, 3) as comma-separated rows without a header."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, points.reshape(len(points), -1), fmt="%.6f", delimiter=",")


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
