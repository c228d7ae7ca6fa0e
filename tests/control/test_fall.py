import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.control.state import has_fallen


def q_at(height, axis="x", degrees=0.0):
    q = np.zeros(19)
    rotation = Rotation.from_euler(axis, degrees, degrees=True)
    q[:4] = rotation.as_quat(scalar_first=True)
    q[6] = height
    return q


def test_a_robot_that_stands_has_not_fallen(go2):
    assert not has_fallen(go2, q_at(go2.stand_height))


@pytest.mark.parametrize("axis", ["x", "y"])
def test_it_has_fallen_beyond_sixty_degrees(go2, axis):
    assert not has_fallen(go2, q_at(1.0, axis, 59.0))
    assert has_fallen(go2, q_at(1.0, axis, 61.0))
    assert has_fallen(go2, q_at(1.0, axis, -61.0))


def test_turning_around_is_not_falling(go2):
    assert not has_fallen(go2, q_at(go2.stand_height, "z", 170.0))


def test_it_has_fallen_when_its_trunk_touches_the_ground(go2):
    """The Go2's trunk is .114 m high and .3762 m long."""
    assert not has_fallen(go2, q_at(0.0571))
    assert has_fallen(go2, q_at(0.0569))
    pitched = 0.057 * np.cos(np.deg2rad(30)) + 0.1881 * np.sin(np.deg2rad(30))
    assert not has_fallen(go2, q_at(pitched + 1e-4, "y", 30.0))
    assert has_fallen(go2, q_at(pitched - 1e-4, "y", 30.0))
