"""Plans for training a tracker, smoothed in advance."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from loco_drake.common.errors import InputError, quoted
from loco_drake.control.plan import Plan, plan_from_motion
from loco_drake.control.retiming import fall_limit, path_limits, smooth_plan
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.legged import LeggedRobot
from loco_drake.models.robots import Robot, SimulatedRobot
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion import Motion
from loco_drake.motion.motion_folder import open_motions


def smooth_motions(robot: SimulatedRobot, motions: Iterable[Motion]) -> list[Plan]:
    """Returns motions as plans, re-timed by the smoother.

    It is for robots with three joints a leg; others follow motion at its own time.
    """
    if not isinstance(robot, Robot):
        return [plan_from_motion(robot, motion) for motion in motions]
    limits = {
        grounded: path_limits(robot, fall_limit(grounded)) for grounded in (False, True)
    }
    return [
        smooth_plan(robot, plan_from_motion(robot, motion), limits[motion.grounded])
        for motion in motions
    ]


def read_motions(robot: LeggedRobot, folder: Path) -> dict[Path, Motion]:
    """Returns the motions in ``folder``, packed or not, by file.

    Raises:
        InputError: if there are none, one is of another robot, or two have one name.
    """
    found = open_motions(folder, nested=False)
    if not found:
        raise InputError(f"There are no Motion files (*.npz) in {str(folder)!r}.")
    motions = {Path(found.path(i)): motion for i, motion in enumerate(found)}
    names = Counter(path.name for path in motions)
    name, count = names.most_common(1)[0]
    if count > 1:  # from several folders that are packed together
        raise InputError(
            f"There are {count} motions called {quoted(name)} in {str(folder)!r}."
        )
    check_robot(robot, motions)
    return motions


def check_robot(robot: LeggedRobot, motions: Mapping[Path, Motion]) -> None:
    """Raises InputError unless all motions, by file, are of a robot."""
    for path, motion in motions.items():
        if motion.robot != robot.name:
            raise InputError(f"{path} is of {motion.robot}, not of {robot.name}.")


def load_references(robot: SimulatedRobot, folder: Path) -> list[Plan]:
    """Returns the Motion files in ``folder`` as plans, see :func:`smooth_motions`.

    Raises:
        InputError: as :func:`read_motions`.
    """
    return smooth_motions(robot, read_motions(robot, folder).values())


def generate_references(
    robot: Robot, labels: Sequence[str], *, count: int, seconds: float, seed: int
) -> list[Plan]:
    """Returns ``count`` plans of each label from the shipped motion model, smoothed.

    Their seeds are those from ``seed`` on.

    Raises:
        InputError: if the model does not know the robot or a label.
    """
    model = pretrained_motion_model(robot.definition)
    seeds = range(seed, seed + count)
    motions: list[Motion] = []
    for label in labels:
        motions += generate_motions(model, parse_label(label), seconds, seeds)
    return smooth_motions(robot, motions)
