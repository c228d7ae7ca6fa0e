"""Plots and figures of one recording, to check its label."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array, Bools
from loco_drake.common.runs import intervals
from loco_drake.models.legs import LEGS
from loco_drake.motion.gait_timing import clip_track, gait_timing
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.contacts import detect_contacts, stance_height
from loco_drake.retargeting.cuts import Cut
from loco_drake.retargeting.scaling import load_config


@dataclass(frozen=True)
class ClipSummary:
    """Figures of a clip; see :mod:`loco_drake.motion.gait_timing`."""

    frames: int  # of the clip
    fps: float  # its rate
    seconds: float  # from the first frame to the last
    stance_height_m: float  # of the middle between withers and hip
    speed_mean_mps: float  # of that point over the ground
    # None, as all that follows, if there are not three strides.
    stride_period_s: float | None
    # Share of the stride that each foot is down, FL, FR, RL, RR.
    duty_factor: tuple[float, ...] | None
    # Lag of each foot behind RL as a share of the stride.
    phase: tuple[float, ...] | None


def summarize(clip: KeypointClip) -> tuple[ClipSummary, Bools]:
    """Returns the summary of a clip and its contacts, shape (T, 4).

    Raises:
        InputError: if the clip is not of an animal on its feet.
    """
    config = load_config(clip.source)
    height = stance_height(clip, config)
    contacts = detect_contacts(clip, height, config.contact)
    timing = gait_timing(clip_track(clip, height))
    summary = ClipSummary(
        frames=len(clip),
        fps=clip.fps,
        seconds=(len(clip) - 1) / clip.fps,
        stance_height_m=height,
        speed_mean_mps=float(trunk_speed(clip).mean()),
        stride_period_s=timing.stride_period if timing else None,
        duty_factor=tuple(timing.duty_factors.tolist()) if timing else None,
        phase=tuple(timing.phase_lags.tolist()) if timing else None,
    )
    return summary, contacts


def trunk_speed(clip: KeypointClip) -> Array:
    """Returns the horizontal speed in m/s of the trunk's middle, shape (T,)."""
    velocity = np.gradient(clip.middle[:, :2], 1 / clip.fps, axis=0)
    speed: Array = np.hypot(velocity[:, 0], velocity[:, 1])
    return speed


def clip_figure(
    clip: KeypointClip, contacts: Bools, cuts: Sequence[Cut], title: str
) -> Figure:
    """Returns a figure of toe heights, gait diagram and speeds over time.

    Proposed cuts are marked and labelled in the gait diagram.
    """
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
    first = cuts[0].start if cuts else 0
    for cut in cuts if len(cuts) > 1 else []:
        start, middle = cut.start - first, (cut.start + cut.end) / 2 - first
        for axes in (heights, gait, speed) if start else ():
            axes.axvline(start / clip.fps, color="k", lw=0.8, ls=":")
        gait.text(middle / clip.fps, 4.55, cut.guess, ha="center", fontsize="small")
    heights.axhline(0.0, color="0.6", lw=0.8)
    heights.set(ylabel="toe height [m]", title=title)
    heights.legend(loc="upper right", ncols=4)
    gait.set(ylabel="on the ground", ylim=(0.4, 4.9))
    gait.set_yticks(range(4, 0, -1), LEGS)
    speed.set(ylabel="speed [m/s]", xlabel="time [s]")
    speed.legend(loc="upper right")
    return figure
