"""A robot and a plan for it."""

import pytest

from loco_drake.control.plan import Plan, plan_from_motion
from loco_drake.models.robots import Robot, get_robot
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="session")
def go2() -> Robot:
    return get_robot("go2")


@pytest.fixture(scope="session")
def trot(go2: Robot) -> Plan:
    """Four seconds of a slow trot that turns."""
    return plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 0.5, 0.2))
