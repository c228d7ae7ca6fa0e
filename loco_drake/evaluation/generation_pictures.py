"""Plots of tokenizer and generator."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.rotations import (
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    yaw_of,
    yaw_quat,
)
from loco_drake.evaluation.recognition import Recognition
from loco_drake.evaluation.recorded import Recorded
from loco_drake.evaluation.samples import by_label, labels_of
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion import Motion

POSES = 8  # stick figures in a strip
STRIP_SECONDS = 0.7
SPACING = 0.75  # m, between them

# Rows of classifiers that have a confusion matrix each: what was told apart by which.
CONFUSIONS = {
    "real_to_real": "recorded, by recorded",
    "real_to_generated": "generated, by recorded",
    "generated_to_real": "recorded, by generated",
}


def generation_figures(
    robot: Robot,
    recorded: Recorded,
    generated: Sequence[Motion],
    recognition: Mapping[str, Recognition],
) -> dict[str, Figure]:
    """Returns all pictures of ``evaluate generation``, by name."""
    figures = {
        f"confusion-{kind}": confusion_figure(found, f"{robot.name}, {kind}")
        for kind, found in recognition.items()
    }
    real = (*recorded.validation, *recorded.train)
    return {**figures, "motion": motion_figure(robot, real, generated)}


def confusion_figure(recognition: Recognition, title: str) -> Figure:
    """Returns three confusion matrices; a row is the true gait."""
    figure = Figure(figsize=(15, 6.6), layout="constrained")
    figure.suptitle(title)
    labels = [str(LABELS[label]) for label in recognition.labels]
    matrices = {}
    for row, what in CONFUSIONS.items():
        mean = recognition.accuracies[row]["all"].mean
        matrices[f"{what}: {mean:.3f}"] = recognition.confusion[row]
    draw_confusions(figure, matrices, labels)
    return figure


def draw_confusions(
    figure: Figure, matrices: Mapping[str, Array], labels: Sequence[str]
) -> None:
    """Draws matrices by title, shape (labels, labels), side by side in an empty figure.

    An entry is the share of its row that was taken for the label of its column.
    """
    count = len(labels)
    columns = figure.subplots(1, len(matrices), sharey=True)
    for axes, (title, matrix) in zip(columns, matrices.items(), strict=True):
        for (row, column), share in np.ndenumerate(matrix):
            if share >= 0.005:
                color = "#1f9d6b" if row == column else "#d9340d"
                alpha = 0.25 + 0.75 * share
                axes.bar(column, 0.92, 0.92, row - 0.46, color=color, alpha=alpha)
                text = f"{100 * share:.0f}"
                axes.text(column, row, text, ha="center", va="center", size=6)
        axes.set(xlim=(-0.6, count - 0.4), ylim=(count - 0.4, -0.6), aspect="equal")
        axes.set_xticks(range(count), labels, rotation=90, size=7)
        axes.set_yticks(range(count), labels, size=7)
        axes.set_xlabel("taken for, %", size=8)
        axes.set_title(title)


def code_use_figure(counts: Integers, title: str) -> Figure:
    """Returns how often the codes of each codebook are used, the most used first.

    The counts have the shape (codebooks, codebook_size).
    """
    figure = Figure(figsize=(8, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for codebook, used in enumerate(counts):
        share = np.sort(used)[::-1] / max(used.sum(), 1)
        color = str(0.75 * codebook / len(counts))
        label = f"codebook {codebook + 1}: {np.count_nonzero(used)} of {len(used)}"
        axes.plot(np.arange(1, len(used) + 1), share, color=color, label=label)
    axes.set(xlabel="code, by use", ylabel="share of the codebook's use", title=title)
    axes.set_yscale("log")
    axes.legend(ncols=3, loc="lower left", fontsize="small")
    return figure


def motion_figure(
    robot: Robot, recorded: Sequence[Motion], generated: Sequence[Motion]
) -> Figure:
    """Returns strips of stick figures, recorded above generated, for each label.

    A strip shows the robot from its left side every tenth of a second, with its left
    legs in front; the first motion of each label is shown.
    """
    sides = {"recorded": by_label(recorded), "generated": by_label(generated)}
    names = labels_of(*sides.values())
    figure = Figure(figsize=(14, 1.3 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), 2, squeeze=False)
    for row, name in zip(axes, names, strict=True):
        for cell, (what, side) in zip(row, sides.items(), strict=True):
            draw_strip(cell, robot, side[name][0])
            cell.set_title(f"{name}, {what}", size=9)
    return figure


def draw_strip(
    axes: Axes,
    robot: Robot,
    motion: Motion,
    *,
    near: tuple[str, str] = ("C0", "C1"),
    ink: str = "k",
) -> None:
    """Draws poses of the first STRIP_SECONDS side by side, from the left, x forward.

    ``near`` are the colours of the left legs, front and rear; the right ones are grey.
    ``ink`` is that of the trunk.
    """
    frames = np.linspace(0, STRIP_SECONDS * motion.fps, POSES).round().astype(int)
    frames = np.minimum(frames, len(motion) - 1)
    q = motion.joint_positions
    hips = np.broadcast_to(robot.p_BHip, (len(motion), 4, 3))
    points = (hips, robot.knee_positions(q), robot.toe_positions(q))
    legs = [_seen(motion, p_B)[frames] for p_B in points]
    for place, (hip, knee, toe) in enumerate(zip(*legs, strict=True)):
        shift = np.array([place * SPACING, 0.0])
        for leg, color in ((1, "0.7"), (3, "0.7"), (0, near[0]), (2, near[1])):
            line = np.stack((hip[leg], knee[leg], toe[leg])) + shift
            axes.plot(*line.T, color=color, lw=1.5)
        trunk = np.stack((hip[:2].mean(axis=0), hip[2:].mean(axis=0))) + shift
        axes.plot(*trunk.T, color=ink, lw=2)
    axes.axhline(0.0, color="0.5", lw=0.8)
    axes.set_aspect("equal")
    axes.axis("off")


def _seen(motion: Motion, points: Array) -> Array:
    """Returns points of the base's frame (T, N, 3), from its side: ahead, up."""
    upright = quat_conjugate(yaw_quat(yaw_of(motion.base_quaternion)))
    q_HB = quat_multiply(upright, motion.base_quaternion)
    level: Array = quat_rotate(q_HB[:, None], points)[..., [0, 2]]
    level[..., 1] += motion.base_position[:, None, 2]
    return level
