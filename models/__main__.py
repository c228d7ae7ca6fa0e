"""Opens a robot in Drake's model visualizer: ``python -m loco_drake.models go2``."""

import argparse
import sys
from collections.abc import Sequence

from pydrake.visualization import ModelVisualizer

from loco_drake.common.errors import InputError

from .robots import ROBOTS, ConfigureParser, get_robot


def main(argv: Sequence[str] | None = None) -> int:
    """Shows the robot named in the arguments until the user quits.

    Returns:
        The exit status: 0, or 2 if there is no such robot.
    """
    parser = argparse.ArgumentParser(
        prog="python -m loco_drake.models",
        description="Look at a robot in Meshcat: its links, frames, toes and joints.",
    )
    parser.add_argument("robot", help=f"one of {', '.join(ROBOTS)}")
    parser.add_argument(
        "--visualize_frames", action="store_true", help="draw each link's frame"
    )
    parser.add_argument(
        "--loop_once", action="store_true", help="draw it once and quit, for tests"
    )
    arguments = parser.parse_args(argv)
    try:
        robot = get_robot(arguments.robot)
        visualizer = ModelVisualizer(visualize_frames=arguments.visualize_frames)
        ConfigureParser(visualizer.parser())
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    visualizer.AddModels(url=robot.url)
    stance = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, robot.stand_height, *robot.stand_joints]
    visualizer.Run(position=stance, loop_once=arguments.loop_once)
    return 0


if __name__ == "__main__":
    sys.exit(main())
