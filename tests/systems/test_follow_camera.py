import re

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.geometry import Meshcat
from pydrake.systems.framework import BasicVector

from loco_drake.models.ground import FLOOR_Z
from loco_drake.systems.follow_camera import FollowCamera


def translation(meshcat, path):
    """Returns the translation that a page would be sent for a path."""
    packed = meshcat._GetPackedTransform(path)
    (numbers,) = re.findall(b"matrix\xdc\x00\x10(.{144})$", packed, re.DOTALL)
    matrix = np.frombuffer(numbers, dtype=[("type", "u1"), ("value", ">f8")])["value"]
    return matrix[12:15]


@pytest.mark.parametrize(
    ("place", "floor"),
    [([0.3, -0.4], [0, 0]), ([2.6, -7.4], [5, -5]), ([1234.5, 99.0], [1235, 100])],
)
def test_the_world_moves_so_that_the_robot_is_at_the_origin(go2, place, floor):
    """The floor lags by less than its size, and by whole periods of its pattern."""
    meshcat = Meshcat()
    camera = FollowCamera(go2, meshcat)
    context = camera.CreateDefaultContext()
    state = np.zeros(37)
    state[4:7] = *place, 0.31
    camera.GetInputPort("state").FixValue(context, Value(BasicVector(state)))
    camera.ForcedPublish(context)
    np.testing.assert_allclose(
        translation(meshcat, "/drake"), [-place[0], -place[1], 0]
    )
    shown = translation(meshcat, "/drake/illustration/floor")
    np.testing.assert_allclose(shown, [*floor, FLOOR_Z])
    np.testing.assert_array_equal(shown[:2] % 1.0, 0)
