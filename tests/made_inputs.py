"""Inputs of odd conventions, made by formula: each as somebody's real file was."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEGS = ("FL", "FR", "RL", "RR")


def walking_animal(
    height: float = 0.44,
    half: float = 0.2,
    lateral: float = 0.08,
    speed: float = 1.0,
    period: float = 0.5,
    duty: float = 0.5,
    fps: float = 60.0,
    seconds: float = 4.0,
    lift: float = 0.06,
) -> tuple[Array, Array, Array]:
    """Returns withers, hip (T, 3) and toes FL FR RL RR (T, 4, 3) of a trot along x.

    z is up; toes that stand are at z = 0 and do not move; withers and hip are level,
    ``height`` m up and ``half`` m before and behind the middle. Toes that swing move
    by half a cosine.
    """
    time = np.arange(round(seconds * fps)) / fps
    middle = np.stack((speed * time, 0 * time, height + 0 * time), axis=-1)
    ahead = np.array([half, 0.0, 0.0])
    toes = np.empty((len(time), 4, 3))
    for leg, lag in enumerate((0.0, 0.5, 0.5, 0.0)):
        stride, phase = np.divmod(time / period + lag, 1.0)
        swing = np.clip((phase - duty) / (1 - duty), 0.0, 1.0)
        steps = stride - lag + duty / 2 + (1 - np.cos(np.pi * swing)) / 2
        toes[:, leg, 0] = steps * period * speed + (half, -half)[leg // 2]
        toes[:, leg, 1] = (lateral, -lateral)[leg % 2]
        toes[:, leg, 2] = lift * np.sin(np.pi * swing) ** 2
    return middle + ahead, middle - ahead, toes


def save_dog(path: Path, withers: Array, hip: Array, toes: Array) -> Path:
    """Writes 27 points of a dog, y up, as the dog's keypoint files have them."""
    points = np.repeat(hip[:, None], 27, axis=1)
    points[:, 3] = withers
    points[:, [10, 15, 19, 23]] = toes
    return save_rows(path, points[..., [0, 2, 1]] * (1.0, 1.0, -1.0))


def mpc_points(withers: Array, hip: Array, toes: Array, side: float = 0.044) -> Array:
    """Returns the nine points of the MPC's files: feet, centre, hips; (T, 9, 3)."""
    left = np.array([0.0, side, 0.0])
    hips = np.stack((withers + left, withers - left, hip + left, hip - left), axis=1)
    return np.concatenate((toes, (withers + hip)[:, None] / 2, hips), axis=1)


def save_rows(path: Path, points: Array) -> Path:
    """Writes a row of comma-separated numbers for each frame."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = np.asarray(points).reshape(len(points), -1)
    np.savetxt(path, rows, delimiter=",", fmt="%.5g")
    return path


def urdf(first: str = "", base: str = "base", turn: str = "0 0 0") -> str:
    """Returns a quadruped of four three-joint legs, thigh and shank of .22 m.

    Args:
        first: elements before its links.
        base: name of its trunk.
        turn: roll, pitch and yaw of the legs about the trunk.
    """
    parts = [f'<robot name="made">{first}<link name="{base}"/>']
    parts.append(
        f'<link name="trunk"/><joint name="turned" type="fixed"><parent link="{base}"/>'
        f'<child link="trunk"/><origin xyz="0 0 0" rpy="{turn}"/></joint>'
    )
    for leg, x, y in zip(LEGS, (0.2, 0.2, -0.2, -0.2), (0.1, -0.1) * 2, strict=True):
        parent = "trunk"
        for part, origin, axis, low, high in (
            ("hip", f"{x} {y} 0", "1 0 0", -1.0, 1.0),
            ("thigh", f"0 {y / 2} 0", "0 1 0", -2.0, 4.0),
            ("calf", "0 0 -0.22", "0 1 0", -2.7, -0.5),
        ):
            child = f"{leg}_{part}"
            parts.append(
                f'<link name="{child}"/><joint name="{child}_joint" type="revolute">'
                f'<parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
                f'<limit lower="{low}" upper="{high}" effort="30" velocity="20"/>'
                "</joint>"
            )
            parent = child
        parts.append(
            f'<link name="{leg}_foot"/><joint name="{leg}_foot_joint" type="fixed">'
            f'<parent link="{parent}"/><child link="{leg}_foot"/>'
            '<origin xyz="0 0 -0.22"/></joint>'
        )
    return "\n".join(parts) + "\n</robot>\n"


def robot_yaml(
    file: str, legs: tuple[str, ...] = LEGS, trunk: str = "base", suffix: str = "joint"
) -> str:
    """Returns the YAML file of :func:`urdf`, whose legs are called ``legs``."""
    lines = [f"urdf: {file}", f"trunk: {trunk}", "foot_radius: 0.02", "legs:"]
    for leg, own in zip(LEGS, legs, strict=True):
        joints = ", ".join(
            f"{own}_{part}_{suffix}" for part in ("hip", "thigh", "calf")
        )
        lines.append(
            f"  {leg}: {{joints: [{joints}], foot: {own}_foot, stand: [0, 0.8, -1.6]}}"
        )
    return "\n".join(lines) + "\n"
