"""Plots of the report as SVG elements in the colours of the page."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from html import escape
from typing import Any, ParamSpec

import matplotlib as mpl
from matplotlib.figure import Figure

from loco_drake.evaluation.dataset_picture import COLORS, library_figure
from loco_drake.evaluation.generation_pictures import (
    CONFUSIONS,
    draw_confusions,
    draw_strip,
)
from loco_drake.evaluation.library import Library
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.report.tables import robot_title
from loco_drake.evaluation.robustness_pictures import curves_figure
from loco_drake.evaluation.steering_grid import draw_grid, grid_errors
from loco_drake.evaluation.tracking import Rollout
from loco_drake.evaluation.tracking_pictures import (
    FAINT,
    TRACED,
    learning_figure,
    returns_figure,
    traces_figure,
)
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import Motion

# Stands for the colour of the page's text until the SVG is written.
INK = "#010203"

_STYLE: dict[str, Any] = {
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "font.family": "sans-serif",
    "font.size": 10,
    "grid.color": FAINT,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "loco_drake",
    "text.color": INK,
    "xtick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.color": FAINT,
    "ytick.labelcolor": INK,
}
_P = ParamSpec("_P")


def _as_svg(draw: Callable[_P, tuple[Figure, str]]) -> Callable[_P, str]:
    """Makes an SVG element of a figure, in the page's style, and what it shows."""

    @wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> str:
        buffer = io.StringIO()
        with mpl.rc_context(_STYLE):  # type: ignore[arg-type, unused-ignore]
            figure, alt = draw(*args, **kwargs)
            figure.savefig(buffer, format="svg", metadata={"Date": None})
        text = buffer.getvalue()
        text = text[text.index("<svg") :].replace(INK, "currentColor")
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        return text.replace("<svg ", f'<svg role="img" aria-label="{escape(alt)}" ', 1)

    return drawn


@_as_svg
def gaits_picture(motions: Mapping[str, Sequence[Motion]]) -> tuple[Figure, str]:
    """Returns the outlines of robots in each gait, a row each.

    All robots have one motion for each of the same labels, in the same order.
    """
    robots = list(motions)
    count = len(motions[robots[0]])
    figure = Figure(figsize=(11, 0.6 * count + 0.3), layout="constrained")
    axes = figure.subplots(count, len(robots), squeeze=False)
    for column, name in enumerate(robots):
        axes[0, column].set_title(robot_title(name))
        for row, motion in enumerate(motions[name]):
            color = COLORS[motion.source]
            cell = axes[row, column]
            draw_strip(cell, get_robot(name), motion, near=(color, color), ink=INK)
            cell.set_ylim(-0.03, 0.43)
            if column == 0:
                style = {"ha": "right", "color": color, "weight": "bold"}
                where = {"transform": cell.transAxes}
                cell.text(-0.01, 0.4, str(motion.label), **where, **style)
    sources = ", ".join(dict.fromkeys(m.source for m in motions[robots[0]]))
    return figure, (
        f"Outlines of {' and '.join(robots)} every tenth of a second in "
        f"{count} generated gaits, from {sources}."
    )


@_as_svg
def library_picture(robot: str, library: Library) -> tuple[Figure, str]:
    """Returns the distribution and diversity of a robot's library of motion."""
    labels = len({point.label for point in library.points})
    return library_figure(library), (
        f"{len(library.points)} stretches of {labels} gaits as motion of {robot}: "
        "seconds, stride period and duty factor against speed, and two principal "
        "components of their features."
    )


@_as_svg
def returns_picture(tracking: Mapping[str, Figures]) -> tuple[Figure, str]:
    """Returns the return of each gait, robot beside robot."""
    figure = returns_figure(tracking, ink=INK)
    return figure, "Normalized return of each gait; the table has the values."


@_as_svg
def traces_picture(rollouts: Mapping[str, Rollout]) -> tuple[Figure, str]:
    """Returns plan and robot over the last seconds of simulations."""
    figure = traces_figure(rollouts, ink=INK)
    return figure, (
        f"Speed, height and two joints of {' and '.join(rollouts)} over two seconds of "
        f"{TRACED}, beside those of the plan."
    )


@_as_svg
def learning_picture(curves: Mapping[str, Figures]) -> tuple[Figure, str]:
    """Returns how returns grew in training, by source."""
    figure, ends = learning_figure(curves, ink=INK)
    return figure, (
        "Learning curves: mean normalized return of each source's gaits against "
        f"millions of steps; at the end {', '.join(ends)}."
    )


@_as_svg
def grid_picture(figures: Figures) -> tuple[Figure, str]:
    """Returns how far a steered robot is off each command of the grid, by gait."""
    errors = grid_errors(figures)
    figure = Figure(figsize=(11, 2.4 + 0.5 * len(errors)), layout="constrained")
    draw_grid(figure, errors, ink=INK)
    return figure, (
        f"How far velocity and yaw rate are off the command at each point of the grid, "
        f"for {len(errors)} gaits; the tables have the errors of all points together."
    )


@_as_svg
def curves_picture(robots: Mapping[str, Figures]) -> tuple[Figure, str]:
    """Returns how often disturbed robots succeed, against the size of each kind."""
    return curves_figure(robots, ink=INK), (
        f"Success of {' and '.join(robots)} against the size of each kind of "
        "disturbance; the tables have the means."
    )


@_as_svg
def confusion_picture(figures: Figures, kind: str) -> tuple[Figure, str]:
    """Returns what gaits were taken for by a kind of classifier, as three matrices."""
    labels = figures.part("confusion").values.get("labels")
    known = [str(label) for label in LABELS]
    if not isinstance(labels, list) or labels != [k for k in known if k in labels]:
        raise figures.damaged("confusion.labels are no gaits")
    within = figures.part("confusion", kind)
    matrices = {
        title: within.matrix(key, len(labels)) for key, title in CONFUSIONS.items()
    }
    figure = Figure(figsize=(11, 4.7), layout="constrained")
    draw_confusions(figure, matrices, labels)
    return figure, (
        f"Confusion matrices of the {kind} classifier over {len(labels)} gaits: "
        "what each gait, a row, was taken for."
    )
