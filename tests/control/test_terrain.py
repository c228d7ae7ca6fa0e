"""The terrain's frame of heights against numbers worked by hand."""

import copy

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_to_matrix
from loco_drake.control.terrain import Terrain, slope

RISE = Terrain(gradient=np.array([0.5, 0.0]))  # 26.6 degrees, up along x


def state(q=(1.0, 0.0, 0.0, 0.0), p=(2.0, 1.0, 1.3), v=(1.0, 0.0, 0.0)):
    result = np.zeros(37)
    result[:4], result[4:7], result[22:25] = q, p, v
    result[7:19] = np.arange(12)
    return result


def test_height_is_measured_from_the_ground_below():
    """At x = 2 the ground is at 1 m; 1 m/s along x loses .5 m/s of height."""
    over = RISE.over_ground(state())
    assert over[6] == pytest.approx(0.3)
    np.testing.assert_allclose(over[22:25], [1.0, 0.0, -0.5])
    others = np.r_[0:6, 7:24, 25:37]
    np.testing.assert_array_equal(over[others], state()[others])
    np.testing.assert_allclose(RISE.in_world(over), state(), atol=1e-12)


def test_a_placed_robot_is_turned_with_the_slope():
    """Its axes follow the plane, its distance from the plane is the plan's height."""
    placed = RISE.placed(state(p=(2.0, 1.0, 0.3)))
    world = RISE.in_world(placed)
    normal = np.array([-0.5, 0.0, 1.0]) / np.sqrt(1.25)
    np.testing.assert_allclose(quat_to_matrix(world[:4])[:, 2], normal, atol=1e-12)
    assert normal @ world[4:7] == pytest.approx(0.3)
    np.testing.assert_allclose(placed[4:6], [2.0, 1.0])
    # 1 m/s along the slope: over the ground it does not rise.
    np.testing.assert_allclose(world[22:25], np.array([1.0, 0.0, 0.5]) / np.sqrt(1.25))
    assert placed[24] == pytest.approx(0.0, abs=1e-12)


def test_level_terrain_changes_nothing():
    level = Terrain(gradient=np.zeros(2))
    for change in (level.over_ground, level.in_world, level.placed):
        np.testing.assert_array_equal(change(state()), state())


def test_a_slope_rises_in_its_direction():
    gradient = slope(22.5, np.pi).gradient
    np.testing.assert_allclose(gradient, [1 - np.sqrt(2), 0.0], atol=1e-12)


def test_a_terrain_is_immutable_and_shared():
    assert copy.deepcopy(RISE) is RISE
    with pytest.raises(ValueError, match="read-only"):
        RISE.gradient[0] = 0.0


@pytest.mark.parametrize(
    "gradient", [[0.1], [0.1, 0.2, 0.3], [np.nan, 0.0], [2.0, 0.0], [np.inf, 0.0]]
)
def test_a_bad_gradient_is_one_sentence(gradient):
    with pytest.raises(InputError, match="at most 30 degrees"):
        Terrain(gradient=np.array(gradient))
