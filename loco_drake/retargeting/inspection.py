"""Pictures and figures of one recording: is it what its name says?"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from loco_drake.intervals import intervals
from loco_drake.keypoints import LEGS, KeypointClip
from loco_drake.retargeting.config import load_config
from loco_drake.retargeting.contacts import detect_contacts
from loco_drake.retargeting.scaling import stance_height

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClipSummary:
    """What a clip shows.

    Attributes:
        frames: of the clip.
        fps: its rate.
        seconds: from the first frame to the last.
        stance_height_m: of the middle between withers and hip.
        speed_mean_mps: of that point over the ground.
        stride_period_s: mean time between touchdowns of one foot, None if no foot
            lands twice.
        duty_factor: share of the time that each foot is down, FL, FR, RL, RR.
        phase: touchdown of each foot after RL's as a share of the stride, None where it
            is not known.
    """

    frames: int
    fps: float
    seconds: float
    stance_height_m: float
    speed_mean_mps: float
    stride_period_s: float | None
    duty_factor: tuple[float, ...]
    phase: tuple[float | None, ...]


def summarize(clip: KeypointClip) -> tuple[ClipSummary, NDArray[np.bool_]]:
    """Returns the summary of a clip and its contacts, shape (T, 4).

    Raises:
        InputError: if the clip is not of an animal on its feet.
    """
    config = load_config(clip.source)
    height = stance_height(clip, config)
    contacts = detect_contacts(clip, height, config.contact)
    landings = [_landings(contacts[:, leg]) / clip.fps for leg in range(len(LEGS))]
    strides = np.concatenate([np.diff(times) for times in landings])
    period = float(strides.mean()) if len(strides) else None
    summary = ClipSummary(
        frames=len(clip),
        fps=clip.fps,
        seconds=(len(clip) - 1) / clip.fps,
        stance_height_m=height,
        speed_mean_mps=float(trunk_speed(clip).mean()),
        stride_period_s=period,
        duty_factor=tuple(float(share) for share in contacts.mean(axis=0)),
        phase=tuple(_phase(times, landings[2], period) for times in landings),
    )
    return summary, contacts


def trunk_speed(clip: KeypointClip) -> Array:
    """Returns the horizontal speed in m/s of the trunk's middle, shape (T,)."""
    middle = (clip.withers + clip.hip)[:, :2] / 2
    velocity = np.gradient(middle, 1 / clip.fps, axis=0)
    speed: Array = np.hypot(velocity[:, 0], velocity[:, 1])
    return speed


def clip_figure(clip: KeypointClip, contacts: NDArray[np.bool_], title: str) -> Figure:
    """Returns a figure of toe heights, gait diagram and speeds over time."""
    figure = Figure(figsize=(12, 8), layout="constrained")
    heights, gait, speed = figure.subplots(3, 1, sharex=True)
    time = np.arange(len(clip)) / clip.fps
    toe_velocity = np.gradient(clip.toes[..., :2], 1 / clip.fps, axis=0)
    for leg, name in enumerate(LEGS):
        color, row = f"C{leg}", len(LEGS) - leg
        heights.plot(time, clip.toes[:, leg, 2], color=color, label=name, lw=1)
        down = [
            (start / clip.fps, (end - start) / clip.fps)
            for start, end in intervals(contacts[:, leg])
        ]
        gait.broken_barh(down, (row - 0.4, 0.8), color=color)
        toe_speed = np.hypot(toe_velocity[:, leg, 0], toe_velocity[:, leg, 1])
        speed.plot(time, toe_speed, color=color, lw=0.7)
    speed.plot(time, trunk_speed(clip), color="k", lw=2, label="trunk")
    heights.axhline(0.0, color="0.6", lw=0.8)
    heights.set(ylabel="toe height [m]", title=title)
    heights.legend(loc="upper right", ncols=4)
    gait.set(ylabel="on the ground", ylim=(0.4, 4.6))
    gait.set_yticks(range(4, 0, -1), LEGS)
    speed.set(ylabel="speed [m/s]", xlabel="time [s]")
    speed.legend(loc="upper right")
    return figure


def _landings(contact: NDArray[np.bool_]) -> Array:
    """Returns the frames at which a toe lands; a clip that starts in contact: no."""
    return np.array(
        [start for start, _ in intervals(contact) if start > 0], dtype=float
    )


def _phase(times: Array, reference: Array, period: float | None) -> float | None:
    """Returns the circular mean of the touchdowns' lag behind the reference's."""
    if period is None or not len(times) or not len(reference):
        return None
    before = reference[np.abs(times[:, None] - reference).argmin(axis=1)]
    lag = np.exp(2j * np.pi * (times - before) / period).mean()
    return float(np.angle(lag) / (2 * np.pi) % 1.0)
