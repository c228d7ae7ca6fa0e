import numpy as np
import pytest
from pydrake.geometry import Meshcat

from loco_drake.control.driving import COMMAND, GAIT, PUSH, RESET
from loco_drake.motion.gaits import GAIT_CHOICES, gait_name
from loco_drake.systems.meshcat_driver import (
    HALT,
    PUSHES,
    RESET_BUTTON,
    SLIDERS,
    STOP,
    MeshcatDriver,
)
from tests.meshcat_messages import click, gamepad, move

FORWARD, SIDEWAYS, TURNING = (slider[0] for slider in SLIDERS)


class Connected:
    """A Meshcat whose page is open somewhere, if ``pages`` is above 0."""

    def __init__(self, meshcat):
        self.meshcat, self.pages = meshcat, 1

    def __getattr__(self, name):
        return getattr(self.meshcat, name)

    def GetNumActiveConnections(self):
        return self.pages


@pytest.fixture(scope="module")
def server():
    return Meshcat()


@pytest.fixture
def meshcat(server):
    server.DeleteAddedControls()
    gamepad(server)
    return Connected(server)


@pytest.fixture
def driver(meshcat):
    return MeshcatDriver(meshcat, GAIT_CHOICES, "dog-trot")


def test_at_first_the_robot_stays_with_its_gait(driver):
    np.testing.assert_array_equal(driver.sample(0.0), [0, 0, 0, 1, 0, 0])
    assert not driver.stopped
    assert driver.notes == ()


def test_sliders_command(meshcat, driver):
    move(meshcat, FORWARD, 1.2)
    move(meshcat, SIDEWAYS, -0.3)
    move(meshcat, TURNING, 0.7)
    np.testing.assert_array_equal(driver.sample(0.1)[COMMAND], [1.2, -0.3, 0.7])
    click(meshcat, HALT)
    np.testing.assert_array_equal(driver.sample(0.2)[COMMAND], 0)
    np.testing.assert_array_equal(driver.sample(0.3)[COMMAND], 0)


def test_buttons_are_pressed_once(meshcat, driver):
    click(meshcat, "horse-walk")
    click(meshcat, RESET_BUTTON)
    click(meshcat, "Push right (arrow)")
    orders = driver.sample(0.1)
    assert gait_name(int(orders[GAIT])) == "horse-walk"
    assert (orders[PUSH], orders[RESET]) == (PUSHES["Push right (arrow)"], 1)
    later = driver.sample(0.12)
    assert later[GAIT] == orders[GAIT]
    assert (later[PUSH], later[RESET]) == (0, 0)
    click(meshcat, STOP)
    assert driver.stopped


def test_a_key_that_is_held_pushes_twice_a_second(meshcat, driver):
    pushes = []
    for k in range(100):
        click(meshcat, "Push left (arrow)")
        pushes.append(driver.sample(0.02 * k)[PUSH])
    assert np.count_nonzero(pushes) == 4
    assert max(pushes) == 6.0


def test_gaits_have_buttons_and_two_keys_go_through_them(meshcat, driver):
    assert set(GAIT_CHOICES) <= set(meshcat.GetButtonNames())
    gaits = []
    for name in 3 * ["Previous gait (Z)"] + 4 * ["Next gait (X)"]:
        click(meshcat, name)
        gaits.append(int(driver.sample(0.1)[GAIT]))
    # From the second label, dog-trot, and round by way of any.
    assert gaits == [0, -1, 14, -1, 0, 1, 2]
    # Twice in a control period, as a slow simulation sees it: back to the first label.
    for _ in range(2):
        click(meshcat, "Previous gait (Z)")
    assert driver.sample(0.1)[GAIT] == 0
    for name, index in (("solo8-wave", 14), ("any", -1)):
        click(meshcat, name)
        assert driver.sample(0.2)[GAIT] == index


def test_a_stick_commands_in_proportion_and_adds_to_the_sliders(meshcat, driver):
    # Left stick forward and to the left, right stick to the left.
    gamepad(meshcat, -1.0, -0.5, -0.8)
    np.testing.assert_allclose(driver.sample(0.1)[COMMAND], [1.0, 0.6, 1.2])
    move(meshcat, FORWARD, 0.3)
    np.testing.assert_allclose(driver.sample(0.2)[COMMAND], [1.3, 0.6, 1.2])
    # A stick is never quite in its middle.
    gamepad(meshcat, 0.05, -0.09, 0.1)
    np.testing.assert_allclose(driver.sample(0.3)[COMMAND], [0.3, 0, 0])


@pytest.mark.parametrize("gone", ["pulled out", "page closed"])
def test_a_gamepad_that_is_gone_is_let_go_visibly(meshcat, driver, gone):
    gamepad(meshcat, 0.0, -1.0, 0.0)
    assert driver.sample(0.1)[0] == 2.0
    assert driver.notes == ()
    if gone == "pulled out":
        gamepad(meshcat)
    else:
        meshcat.pages = 0
    np.testing.assert_array_equal(driver.sample(0.2)[COMMAND], 0)
    assert driver.notes == ("gamepad is gone",)


def test_axes_that_are_not_finite_or_out_of_range_are_limited_visibly(meshcat, driver):
    for axes, command in (
        ((np.nan, -np.inf, 0.0), [0, 0, 0]),
        ((0.0, -7.0, 1e300), [2.0, 0, -1.5]),
    ):
        gamepad(meshcat, *axes)
        np.testing.assert_array_equal(driver.sample(0.1)[COMMAND], command)
        assert driver.notes == ("gamepad limited",)
    gamepad(meshcat, 0.5)
    np.testing.assert_allclose(driver.sample(0.1)[COMMAND], [0, -0.3, 0])
    assert driver.notes == ()


@pytest.mark.parametrize(
    ("value", "forward"), [(99.0, 3.5), (-99.0, -1.5), (np.nan, 0.0), (np.inf, 0.0)]
)
def test_sliders_beyond_their_ends_are_limited_visibly(meshcat, driver, value, forward):
    move(meshcat, FORWARD, value)
    assert driver.sample(0.1)[0] == forward
    assert driver.notes == ("command limited",)
