"""One picture of retargeted motion: poses in a row, a row for each robot.

What the paper's Figure 1 shows: the robots, and over them the keypoints of the
recording that they were retargeted from.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.datasets.segments import Segment
from loco_drake.models.legged import LeggedRobot
from loco_drake.models.quadruped import Quadruped
from loco_drake.motion.gait_timing import clip_track, gait_timing
from loco_drake.motion.momentum import positions
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.retarget import SegmentRetargeter
from loco_drake.retargeting.scaling import AS_RECORDED, Variant, resample
from loco_drake.systems.keypoint_visualizer import COLORS
from loco_drake.viewing.rendering import Camera, Picture
from loco_drake.viewing.stage import Stage
from loco_drake.viewing.takes import Scene, Take

POSES = 4  # in a row, over one stride
_SPACING = 2.8  # between poses, over the height of the stance
_RADIUS = 0.06  # of a keypoint, over the height of the stance
_STRIDE = 0.8  # s, of a clip without a rhythm
_SIZE = 1600, 350  # pixels of a row
# The camera stands far to the right of the robot, a little above it: all poses are seen
# from nearly the same side.
_FAR = 60.0  # over the height of the stance
_ABOVE = 0.13  # over the distance
_KINDS = ("front feet", "rear feet", "withers and hip")


def poses_figure(
    segment: Segment,
    robots: Sequence[Quadruped],
    names: Sequence[str],
    variant: Variant = AS_RECORDED,
) -> Figure:
    """Returns a row of poses for each robot, the first one on top.

    Front feet are blue, rear feet red, withers and hip green, in the robot's size.

    Args:
        segment: a stretch of a recording; the middle of it is shown.
        robots: the robots.
        names: what the rows are called.
        variant: changes to the recording.

    Raises:
        InputError: if the stretch cannot be retargeted.
        OSError: if this machine cannot render.
    """
    return rows_figure([_poses(segment, robot, variant) for robot in robots], names)


def rows_figure(
    rows: Sequence[Sequence[Take]], names: Sequence[str], kinds: Sequence[str] = _KINDS
) -> Figure:
    """Returns rows of poses, such as :func:`row_of` makes.

    Args:
        rows: the rows, the first one on top.
        names: what they are called.
        kinds: what the blue, the red and the green points are.

    Raises:
        OSError: if this machine cannot render.
    """
    width, height = _SIZE
    figure = Figure(figsize=(width / 100, len(rows) * height / 100), dpi=100)
    axes = figure.subplots(len(rows), squeeze=False)[:, 0]
    figure.subplots_adjust(0, 0, 1, 1, 0, 0)
    for cell, row, name in zip(axes, rows, names, strict=True):
        _draw(cell, row)
        cell.text(14, 34, name, size=17, weight="bold", color="#1c2228")
    seen = [COLORS[0], COLORS[2], COLORS[4]]
    handles = [
        Line2D([], [], ls="", marker="o", ms=9, color=color.rgba[:3]) for color in seen
    ]
    axes[0].legend(
        handles, kinds, loc="upper right", ncols=3, fontsize=12, frameon=False
    )
    return figure


def _poses(segment: Segment, robot: Quadruped, variant: Variant) -> list[Take]:
    """Returns the poses of a robot, each a take of one frame beside the one before."""
    made = SegmentRetargeter(robot, variant=variant)(segment)
    if isinstance(made, str):
        raise InputError(made)
    clip, motion, report = made
    moved = resample(clip, FPS)
    ends = moved.withers[:, None], moved.hip[:, None]
    points = report.scale * np.concatenate((moved.toes, *ends), axis=1)
    timing = gait_timing(clip_track(moved, robot.stand_height / report.scale), 2)
    stride = timing.stride_period if timing else _STRIDE
    return row_of(robot, positions(motion), points, stride)


def row_of(robot: LeggedRobot, q: Array, points: Array, stride: float) -> list[Take]:
    """Returns poses over a stride in the middle, each a take of one frame.

    Args:
        robot: the robot.
        q: its positions at 50 frames/s, see :class:`.Take`, shape (T, 7 + J).
        points: points shown over them, m, shape (T, 6, 3).
        stride: duration, s.
    """
    count = min(len(q), len(points))
    frames = count / 2 + stride * FPS * (np.arange(POSES) / POSES - 0.5)
    takes = []
    for place, frame in enumerate(np.clip(frames.round().astype(int), 0, count - 1)):
        shift = np.append(-q[frame, 4:6], 0.0)
        shift[0] += (place - (POSES - 1) / 2) * _SPACING * robot.stand_height
        pose = q[frame : frame + 1].copy()
        pose[:, 4:7] += shift
        takes.append(Take("", robot, FPS, pose, points[frame : frame + 1] + shift))
    return takes


def _draw(axes: Axes, takes: Sequence[Take]) -> None:
    """Draws poses, and over them their points."""
    robot = takes[0].robot
    picture, camera = _picture(takes)
    axes.imshow(picture)
    axes.axis("off")
    for take in takes:
        assert take.points is not None
        centres, scales = camera.project(take.points[0])
        # What is far is drawn first.
        for k in np.argsort(scales):
            radius = _RADIUS * robot.stand_height * scales[k]
            _draw_sphere(axes, centres[k], radius, COLORS[k].rgba[:3])


def _picture(takes: Sequence[Take]) -> tuple[Picture, Camera]:
    bare = tuple(replace(take, points=None) for take in takes)
    scene = Scene(bare, lanes=(0.0,) * len(bare))
    stage = Stage([scene], rendered=True)
    stage.set_up(scene, 0.0)
    height = takes[0].robot.stand_height
    target = np.array([0.0, 0.0, 0.6 * height])
    away = _FAR * height
    eye = target + away * np.array([0.0, -1.0, _ABOVE])
    width_m = (POSES + 0.1) * _SPACING * height
    view = 2 * np.arctan(width_m / 2 / away * _SIZE[1] / _SIZE[0])
    camera = Camera(eye, target, _SIZE, float(view))
    return camera.take(stage.query_object), camera


def _draw_sphere(axes: Axes, at: Array, radius: float, color: Sequence[float]) -> None:
    """Draws a disc with a rim and a light, in pixels."""
    x, y = map(float, at)
    light = x - 0.3 * radius, y - 0.35 * radius
    axes.add_patch(Circle((x, y), radius, facecolor=color, edgecolor="white", lw=0.8))
    axes.add_patch(Circle(light, 0.28 * radius, color="white", alpha=0.6, lw=0))
