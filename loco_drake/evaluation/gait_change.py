"""Smoothness of gait changes, and the time until the new gait is reached.

A discontinuity shows as a step or acceleration of joints or base that the gaits
themselves do not contain. The peaks of a motion are the maxima over consecutive frames
of

joint_step_rad                 change of any joint
joint_acceleration_rad_s2      change of any joint's velocity over time
base_step_m                    change of the base's position
base_acceleration_mps2         change of its velocity over time
base_turn_acceleration_rad_s2  change of its angular velocity over time

The peaks in the AROUND seconds about a change are divided by the largest peaks of
motions that keep one of the two gaits: up to 1, the change is no rougher than the
gaits.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array, Bools
from loco_drake.generation.features import VELOCITY, motion_features
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import GaitSchedule
from loco_drake.motion.motion import Motion

AROUND = 0.5  # s
SMOOTHED = 0.5  # s over which the picture's speed is averaged


def peaks(motion: Motion) -> dict[str, float]:
    """Returns the largest changes between frames; see above."""

    def greatest(values: Array, rate: float = 1.0, *, of_each: bool = False) -> float:
        change = np.diff(values, axis=0) * rate
        sizes = np.abs(change) if of_each else np.linalg.norm(change, axis=-1)
        return float(sizes.max())

    fps = motion.fps
    return {
        "joint_step_rad": greatest(motion.joint_positions, of_each=True),
        "joint_acceleration_rad_s2": greatest(
            motion.joint_velocities, fps, of_each=True
        ),
        "base_step_m": greatest(motion.base_position),
        "base_acceleration_mps2": greatest(motion.base_velocity, fps),
        "base_turn_acceleration_rad_s2": greatest(motion.base_angular_velocity, fps),
    }


def roughness(
    motion: Motion, time: float, steady: Iterable[Motion]
) -> dict[str, float]:
    """Returns the peaks of a motion about a gait change relative to steady gaits.

    ``time`` is that of the change in s, not at the motion's ends; ``steady`` are
    motions of the gaits before and after.
    """
    first = round((time - AROUND / 2) * motion.fps)
    last = round((time + AROUND / 2) * motion.fps)
    change = peaks(motion.slice(first, last + 1))
    usual = [peaks(each) for each in steady]
    return {key: value / max(u[key] for u in usual) for key, value in change.items()}


def forward_speed(robot: Robot, motion: Motion) -> Array:
    """Returns the velocity of the base along its heading, m/s, shape (T,)."""
    return motion_features(robot, motion)[:, VELOCITY][:, 0] * robot.stand_height


def change_figure(robot: Robot, motion: Motion, schedule: GaitSchedule) -> Figure:
    """Returns a plot of contacts and speed over time, with the labels."""
    time = np.arange(len(motion)) / motion.fps
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    feet, speed = figure.subplots(2, 1, sharex=True)
    names = ("front left", "front right", "rear left", "rear right")
    for row, stands in enumerate(motion.contacts.T):
        feet.broken_barh(_stretches(stands, motion.fps), (-row - 0.4, 0.8), color="0.3")
    feet.set_yticks(-np.arange(4), names)
    feet.set_title("feet on the ground", size=10, loc="left")
    window = np.ones(round(SMOOTHED * motion.fps))
    forward = forward_speed(robot, motion)
    mean = np.convolve(forward, window, "same") / np.convolve(
        np.ones_like(forward), window, "same"
    )
    speed.plot(time, forward, color="0.75", lw=0.8)
    speed.plot(time, mean, color="C0")
    speed.set(xlabel="s", ylabel="m/s", xlim=(0, time[-1]))
    speed.set_title(f"speed, and its mean over {SMOOTHED:g} s", size=10, loc="left")
    for label, start in zip(schedule.labels, schedule.starts, strict=True):
        for axes in (feet, speed):
            axes.axvline(start, color="C3", lw=1)
        feet.text(start, 0.6, f" {label}", color="C3", va="bottom", size=10)
    feet.set_ylim(-3.6, 1.4)
    return figure


def _stretches(stands: Sequence[bool] | Bools, fps: float) -> Array:
    """Returns start and length in s of each stretch of True, shape (N, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], stands, [0]))))
    starts, ends = edges[::2], edges[1::2]
    return np.column_stack((starts, ends - starts)) / fps
