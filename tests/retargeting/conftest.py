"""Both robots, and a solver of each that a module's tests share."""

import pytest

from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.inverse_kinematics import LegSolver


@pytest.fixture(scope="module", params=["go2", "a1"])
def robot(request):
    return get_robot(request.param)


@pytest.fixture(scope="module")
def solver(robot):
    return LegSolver(robot, FPS)
