"""Plans for a Go2, made by formula."""

import pytest

from loco_drake.control.plan import Plan
from loco_drake.models.robots import get_robot
from loco_drake.tracking.references import smooth_motions
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="session")
def plans() -> list[Plan]:
    """A slow trot and a slow pace of three seconds."""
    motions = [
        synthetic_motion("dog-trot", 3.0, 0.3),
        synthetic_motion("dog-pace", 3.0, 0.3),
    ]
    return smooth_motions(get_robot("go2"), motions)
