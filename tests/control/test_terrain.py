"""The terrain's frame of heights against numbers worked by hand."""

import copy

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_to_matrix
from loco_drake.control.terrain import Terrain, slope_gradient, toes_in_world
from loco_drake.models.robots import get_robot

GO2 = get_robot("go2")
GO2_FEET = [[0.2, 0.14], [0.2, -0.14], [-0.2, 0.14], [-0.2, -0.14]]  # about, m
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
    placed = RISE.placed(GO2, state(p=(2.0, 1.0, 0.3)))
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
    for same in (level.over_ground(state()), level.placed(GO2, state())):
        np.testing.assert_array_equal(same, state())


def test_a_slope_rises_in_its_direction():
    gradient = slope_gradient(22.5, np.pi)
    np.testing.assert_allclose(gradient, [1 - np.sqrt(2), 0.0], atol=1e-12)


def test_bumps_have_their_size_and_their_gradient():
    """A standard deviation of a quarter of 4 cm over 20 m; central differences."""
    terrain = Terrain(gradient=np.array([0.1, 0.0]), roughness=0.04, seed=2)
    p = np.random.default_rng(0).uniform(-10, 10, (4000, 2))
    height, gradient = terrain.surface(p)
    bumps = height - 0.1 * p[:, 0]
    assert bumps.mean() == pytest.approx(0.0, abs=1e-3)
    assert bumps.std() == pytest.approx(0.01, rel=0.05)
    for axis in (0, 1):
        ahead = 1e-4 * np.eye(2)[axis]
        slopes = terrain.surface(p + ahead)[0] - terrain.surface(p - ahead)[0]
        np.testing.assert_allclose(gradient[:, axis], slopes / 2e-4, atol=1e-5)
    other = Terrain(gradient=terrain.gradient, roughness=0.04, seed=3)
    assert np.abs(other.surface(p)[0] - height).max() > 0.01


def test_a_robot_is_placed_on_the_highest_bump_under_its_feet():
    bumpy = Terrain(gradient=np.zeros(2), roughness=0.05, seed=1)
    stands = state(p=(0.7, 0.2, GO2.stand_height))
    stands[7:19] = GO2.stand_joints
    toes = toes_in_world(GO2, bumpy.placed(GO2, stands)[:19])
    np.testing.assert_allclose(toes[:, :2] - [0.7, 0.2], GO2_FEET, atol=0.1)
    gaps = toes[:, 2] - GO2.foot_radius - bumpy.surface(toes[:, :2])[0]
    assert gaps.min() == pytest.approx(0.0, abs=1e-9)
    assert gaps.max() > 0.005


def test_the_mean_ground_rises_gradually_at_a_step():
    """5 cm at 2 m over 40 cm: half of it at the edge, at 5 cm / 40 cm times v_x."""
    terrain = Terrain(gradient=np.zeros(2), step=0.05, step_x=2.0)
    for x, height, rate in ((1.0, 0.3, 0.0), (2.0, 0.275, -0.125), (2.5, 0.25, 0.0)):
        over = terrain.over_ground(state(p=(x, 1.0, 0.3)))
        assert over[6] == pytest.approx(height)
        assert over[24] == pytest.approx(rate)
        np.testing.assert_allclose(
            terrain.in_world(over), state(p=(x, 1.0, 0.3)), atol=1e-12
        )


@pytest.mark.parametrize("part", [{"roughness": 1.0}, {"step": -0.1}, {"step_x": -1}])
def test_numbers_out_of_bounds_are_refused(part):
    with pytest.raises(InputError, match=f"A terrain's {next(iter(part))} must be"):
        Terrain(gradient=np.zeros(2), **part)


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
