"""The plans that a tracker is trained on: smoothed once, before the episodes."""

from pathlib import Path

from loco_drake.errors import InputError
from loco_drake.models.robots import Robot
from loco_drake.motion import load_motion
from loco_drake.systems.plan import Plan, plan_from_motion
from loco_drake.systems.retiming import joint_limits
from loco_drake.systems.toppra_smoother import smooth_plan


def load_references(robot: Robot, folder: Path) -> list[Plan]:
    """Returns the Motion files in ``folder`` as plans, re-timed by the smoother.

    Raises:
        InputError: if there are none, or one is of another robot.
    """
    paths = sorted(Path(folder).glob("*.npz"))
    if not paths:
        raise InputError(f"There are no Motion files (*.npz) in {str(folder)!r}.")
    limits = joint_limits(robot)
    plans = []
    for path in paths:
        motion = load_motion(path)
        if motion.robot != robot.name:
            raise InputError(f"{path} is of {motion.robot}, not of {robot.name}.")
        plans.append(smooth_plan(robot, plan_from_motion(robot, motion), limits))
    return plans
