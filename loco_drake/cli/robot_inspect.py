"""The command ``robot inspect``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from loco_drake.cli.options import Json, Output, UnusedSeed, option
from loco_drake.cli.output import do_all, print_table, say, write_json
from loco_drake.common.errors import InputError

if TYPE_CHECKING:
    from loco_drake.models.robots import SimulatedRobot


@dataclass(kw_only=True)
class RobotInspect:
    """Check a robot's YAML file, and list what the robot is simulated with, and why.

    The exit status is 1 if its motors cannot hold its stance.
    """

    # The robot's YAML file, see docs/own_robot.md and docs/humanoid.md.
    file: Annotated[Path, tyro.conf.Positional, option(metavar="FILE")]
    # Picture to write: the robot in its stance, *.png.
    picture: Annotated[Path | None, option(metavar="FILE"), Output.FILE] = None
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Checks, prints and writes; returns the exit status."""
        from loco_drake.models.robot_files import is_robot_file
        from loco_drake.models.robots import Robot, get_simulated, robot_settings
        from loco_drake.models.standing import stand

        if not is_robot_file(str(self.file)):
            raise InputError(
                f"A robot's file is named *.yaml or *.yml, not {str(self.file)!r}."
            )
        if self.picture is not None and self.picture.suffix != ".png":
            raise InputError(f"--picture must end in .png, not {str(self.picture)!r}.")
        robot = get_simulated(str(self.file))
        settings = robot_settings(self.file)
        # A humanoid sways for longer.
        seconds = 2.0 if isinstance(robot, Robot) else 10.0
        stood = stand(robot, seconds)
        if self.picture is not None:
            _draw(robot, self.picture)
        figures = {
            "robot": robot.name,
            "settings": {s.what: [s.value, s.source] for s in settings},
            "stands": stood.stands,
            "sunk_m": stood.sunk,
            "tilt_rad": stood.tilt,
        }
        title = f"{robot.name}, simulated"
        do_all(
            lambda: print_table(title, ("number", "value", "from"), settings),
            lambda: write_json(self.json, figures),
        )
        if stood.stands:
            print(f"It stands; its trunk sinks by {1000 * stood.sunk:.0f} mm.")
            return 0
        say(
            f"It does not stand: after {seconds:g} s its trunk is "
            f"{1000 * stood.sunk:.0f} mm lower and tilted by {stood.tilt:.2f} "
            "rad; compare gains, effort and stance."
        )
        return 1


def _draw(robot: "SimulatedRobot", path: Path) -> None:
    """Writes a picture of a robot in its stance."""
    import numpy as np
    from PIL import Image

    from loco_drake.common.files import atomic_path
    from loco_drake.viewing.replay import pictures
    from loco_drake.viewing.takes import Scene, Take

    q = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, robot.stand_height, *robot.stand_joints]
    scene = Scene((Take(robot.name, robot, 1.0, np.array([q])),))
    (picture,) = pictures((scene,), 1.0)
    with atomic_path(path) as temporary:
        Image.fromarray(picture).save(temporary, "PNG")
