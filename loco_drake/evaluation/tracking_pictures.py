"""Plots of how well the policy tracks: its returns, its motion, how it learned.

The tracking performance of the low-level policy, as in the paper's Figure 3.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import HEIGHT, JOINTS, split
from loco_drake.evaluation.dataset_picture import COLORS
from loco_drake.evaluation.report.content import CONTENT
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.report.tables import robot_title
from loco_drake.evaluation.tracking import Recorder, Rollout, forward_speeds
from loco_drake.motion.gaits import LABELS, SOURCES
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy

# Readable on white, on near-black and by the colour-blind.
ROBOT_COLORS = {"go2": "#2e86c9", "a1": "#d9730d"}
FAINT = "#808890"
TRACED = "dog-pace"  # the gait of the paper's Figure 1

_SECONDS, _SHOWN = 5.0, 2.0  # of a simulation, and the last ones of these
_TALL = 15.0  # of 100: bars that a number fits into
# Lines among the returns: the goals that they are of.
_AIMS = {
    "aim, mean": "normalized return, mean of all gaits",
    "aim, worst gait": "normalized return, worst gait",
}
_GAP = 5.0  # over the usual distance of a curve's points
# Joints of the front left leg: hip, thigh, calf.
_THIGH, _CALF = 1, 2


def returns_figure(tracking: Mapping[str, Figures], *, ink: str = "k") -> Figure:
    """Returns the return of each gait, robot beside robot."""
    labels = [str(label) for label in LABELS]
    figure = Figure(figsize=(11, 3.9), layout="constrained")
    axes = figure.add_subplot()
    width = 0.8 / len(tracking)
    for place, (robot, figures) in enumerate(tracking.items()):
        found = dict(figures.parts("labels"))
        for x, label in enumerate(labels):
            part = found.get(label)
            if part is None or (value := part.required("normalized_return")) is None:
                continue
            at = x + (place - (len(tracking) - 1) / 2) * width
            axes.bar(at, value, 0.9 * width, color=ROBOT_COLORS[robot])
            worst = part.number("normalized_return_worst")
            if worst is not None:
                axes.plot([at], [worst], "_", color=ink, ms=9, mew=2)
            height, color = (2, "white") if value > _TALL else (value + 1, ink)
            text = f"{value:.0f}"
            axes.text(at, height, text, ha="center", size=8, color=color)
        name = robot_title(robot)
        axes.bar([np.nan], [np.nan], color=ROBOT_COLORS[robot], label=name)
    axes.plot([], [], "_", color=ink, ms=9, mew=2, label="worst episode")
    goals = {goal.title: goal for own in CONTENT.goals.values() for goal in own}
    for what, title in _AIMS.items():
        aim = goals[title].aim.least
        axes.axhline(aim, color=FAINT, ls="--", lw=1, zorder=0)
        axes.text(len(labels) - 0.45, aim, what, va="bottom", color=FAINT, size=8)
    axes.set_xticks(range(len(labels)), labels, rotation=35, ha="right")
    axes.set(ylim=(0, 105), xlim=(-0.6, len(labels) + 0.9))
    axes.set_ylabel("normalized return, of 100")
    figure.legend(loc="outside upper right", ncols=3)
    return figure


def record_traces(robots: Iterable[str], seed: int = 0) -> dict[str, Rollout]:
    """Simulates the shipped policy of each robot in the gait TRACED."""
    rollouts = {}
    for robot in robots:
        scenario = Scenario(
            robot=robot,
            reference=GeneratedReference(gait=TRACED, seed=seed, duration=_SECONDS),
            policy=TrainedPolicy(),
        )
        recorder = Recorder(scenario)
        recorder.start()
        rollouts[robot], _ = recorder.run(_SECONDS)
    return rollouts


def traces_figure(rollouts: Mapping[str, Rollout], *, ink: str = "k") -> Figure:
    """Returns plan and robot over the last seconds of simulations, by robot."""
    figure = Figure(figsize=(5.5 * len(rollouts), 5.4), layout="constrained")
    axes = figure.subplots(4, len(rollouts), squeeze=False, sharex="col", sharey="row")
    for column, (robot, rollout) in zip(axes.T, rollouts.items(), strict=True):
        planned, made = _traces(rollout.plan_state), _traces(rollout.state)
        time = np.arange(len(rollout.state)) * PLAN_DT
        shown = time >= time[-1] - _SHOWN
        for cell, (what, values) in zip(column, made.items(), strict=True):
            cell.plot(time[shown], values[shown], color=ROBOT_COLORS[robot], lw=2.2)
            plan = planned[what][shown]
            cell.plot(time[shown], plan, color=ink, lw=1.1, ls=(0, (4, 2)))
            cell.margins(x=0)
            cell.grid(visible=True)
        column[0].set_title(robot_title(robot))
        column[-1].set_xlabel("time, s")
        column[-1].plot([], [], color=ROBOT_COLORS[robot], lw=2.2, label="robot")
        column[-1].plot([], [], color=ink, lw=1.1, ls=(0, (4, 2)), label="plan")
        column[-1].legend(loc="lower right", ncols=2, fontsize=8)
    for cell, what in zip(axes[:, 0], made, strict=True):
        cell.set_ylabel(what)
    return figure


def _traces(state: Array) -> dict[str, Array]:
    """Returns what is shown of states (N, 37), by title, each of shape (N,)."""
    q, _ = split(state)
    joints = q[JOINTS]
    return {
        "forward, m/s": forward_speeds(state),
        "height, m": state[:, HEIGHT],
        "thigh, rad": joints[:, _THIGH],
        "calf, rad": joints[:, _CALF],
    }


def learning_figure(
    curves: Mapping[str, Figures], *, ink: str = "k"
) -> tuple[Figure, list[str]]:
    """Returns how returns grew in training, by source, and where each curve ended.

    A line ends where steps have no record, and the mean of a source's gaits also where
    a gait joins or leaves. The figures of each robot are those with "learning".
    """
    figure = Figure(figsize=(5.5 * len(curves), 3.8), layout="constrained")
    axes = figure.subplots(1, len(curves), squeeze=False, sharey=True)[0]
    ends = []
    for cell, (robot, figures) in zip(axes, curves.items(), strict=True):
        steps, by_source = _curves(figures)
        for source, returns in by_source.items():
            for values in returns:
                _draw_curve(cell, steps, values, source, lw=0.8, alpha=0.35)
            # Of the labels that are trained on at that time.
            mean = np.ma.masked_invalid(returns).mean(axis=0).filled(np.nan)
            known = np.isfinite(returns)
            breaks = np.flatnonzero((known[:, 1:] != known[:, :-1]).any(axis=0)) + 1
            _draw_curve(cell, steps, mean, source, breaks, lw=2.2, label=source)
            ends.append(f"{robot} {source} {mean[-1]:.0f}")
        cell.axhline(100, color=FAINT, ls="--", lw=1)
        cell.text(0, 101.5, "most that can be had", color=FAINT, size=8)
        cell.set(xlabel="million steps of 20 ms", ylim=(0, 108), xlim=(0, None))
        cell.set_title(robot_title(robot), color=ink)
        cell.grid(visible=True)
        cell.legend(loc="lower right", ncols=2)
    axes[0].set_ylabel("normalized return in training, of 100")
    return figure, ends


def _draw_curve(
    axes: Axes,
    steps: Array,
    values: Array,
    source: str,
    breaks: Iterable[int] = (),
    **style: Any,
) -> None:
    """Draws a curve that ends before each of the points ``breaks``, and at a gap."""
    apart = np.diff(steps)
    usual = np.median(apart) if len(apart) else 0.0
    gaps = np.flatnonzero(apart > _GAP * usual) + 1
    places = sorted({*map(int, gaps), *map(int, breaks)})
    x, y = (np.insert(line, places, np.nan) for line in (steps, values))
    axes.plot(x, y, color=COLORS[source], **style)


def _curves(figures: Figures) -> tuple[Array, dict[str, Array]]:
    """Returns steps in millions, (N,), and returns by source, (labels, N)."""
    steps = np.array(figures.numbers("learning", "steps"), float) / 1e6
    by_source: dict[str, list[Array]] = {source: [] for source in SOURCES}
    for label in figures.part("learning", "return").values:
        values = np.array(figures.numbers("learning", "return", label), float)
        source = label.split("-")[0]
        if source not in by_source or len(values) != len(steps):
            raise figures.damaged(f"learning.return.{label} is no curve of a gait")
        by_source[source].append(values)
    return steps, {name: np.array(found) for name, found in by_source.items() if found}
