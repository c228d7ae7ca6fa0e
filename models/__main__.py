"""Opens a robot in Drake's model visualizer: ``python -m loco_drake.models go2``."""

import sys
from collections.abc import Sequence

import tyro
from pydrake.visualization import ModelVisualizer

from loco_drake.common.errors import InputError

from .robots import get_robot


def show(
    robot: tyro.conf.Positional[str],
    visualize_frames: bool = False,
    loop_once: bool = False,
) -> int:
    """Shows a robot in Meshcat: its links, frames, toes and joints.

    Args:
        robot: go2, a1, or a robot's YAML file.
        visualize_frames: draw each link's frame.
        loop_once: draw it once and quit, for tests.
    """
    try:
        model = get_robot(robot)
        visualizer = ModelVisualizer(visualize_frames=visualize_frames)
        model.AddModel(visualizer.parser(), visual=True)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    stance = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, model.stand_height, *model.stand_joints]
    visualizer.Run(position=stance, loop_once=loop_once)
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Runs :func:`show`; returns 0, or 2 if there is no such robot."""
    return tyro.cli(show, prog="python -m loco_drake.models", args=argv)


if __name__ == "__main__":
    sys.exit(main())
