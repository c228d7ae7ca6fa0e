"""References of a tracker: only what no robot can do is slowed."""

from dataclasses import replace

import numpy as np
import pytest

from loco_drake.control.retiming import GROUNDED_FALL, path_limits
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import FPS
from loco_drake.tracking.references import smooth_motions
from tests.synthetic_motion import synthetic_motion


def test_trunk_of_grounded_motion_may_fall_faster_than_a_body():
    """A trunk that falls at 1.5 g is slowed, unless legs that are drawn up push it."""
    robot = get_robot("go2")
    motion = synthetic_motion("dog-trot", 3.0)
    time = np.arange(len(motion)) / FPS
    size = 1.5 * 9.81 / (2 * np.pi * 3) ** 2
    position = motion.base_position.copy()
    position[:, 2] = robot.stand_height + size * np.sin(2 * np.pi * 3 * time)
    hop = replace(motion, base_position=position)
    told = replace(hop, provenance={**hop.provenance, "momentum_error": "0.01"})
    assert (hop.grounded, told.grounded) == (False, True)
    slowed, kept = smooth_motions(robot, [hop, told])
    assert len(slowed) > 1.05 * len(hop)
    assert len(kept) == pytest.approx(len(hop), abs=2)
    assert path_limits(robot, GROUNDED_FALL).acceleration[-1, 0] == -2 * 9.81
