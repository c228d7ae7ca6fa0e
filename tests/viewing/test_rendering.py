from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from loco_drake.motion.motion import FPS
from loco_drake.systems.keypoint_visualizer import keypoints
from loco_drake.viewing import rendering
from loco_drake.viewing.captions import Caption
from loco_drake.viewing.rendering import HEIGHT, WIDTH, make_engine
from loco_drake.viewing.replay import pictures
from loco_drake.viewing.takes import Scene, Take, take_of_motion
from tests.process import run_python
from tests.synthetic_motion import synthetic_motion
from tests.viewing.pictures import (
    below_the_caption,
    needs_renderer,
    plan_pixels,
    robot_columns,
)


@needs_renderer
def test_the_robot_stays_in_the_picture_while_it_runs_metres(go2):
    """It fills more than a tenth of the width, near the middle, and the floor moves."""
    take = take_of_motion("a", synthetic_motion(seconds=4.0, speed=1.4), go2)
    assert take.q[-1, 4] > 5
    taken = list(pictures([Scene((take,))], 0.5))
    assert len(taken) == 3
    for picture in taken:
        assert picture.shape == (HEIGHT, WIDTH, 3)
        columns = np.flatnonzero(robot_columns(picture))
        assert len(columns) > WIDTH / 10
        assert abs(np.median(columns) - WIDTH / 2) < WIDTH / 8
        # The floor's tiles are of two greys, and the sky is blue.
        ground = picture[-20:].reshape(-1, 3).astype(int)
        assert np.ptp(ground[:, 0]) > 15
        assert picture[0, 0, 2] > picture[0, 0, 0] + 25
    for one, other in pairwise(taken):
        assert (np.abs(one.astype(int) - other) > 8).any(axis=-1).mean() > 0.02


@needs_renderer
def test_the_plan_is_seen_beside_the_robot(go2):
    """In the colours that Meshcat gives its points, and only if there is one."""
    take = take_of_motion("a", synthetic_motion(seconds=0.2), go2)
    plan_q = take.q.copy()
    plan_q[:, 5] -= 0.1
    planned = Take("a", go2, FPS, take.q, keypoints(go2, plan_q))
    (alone,) = pictures([Scene((take,))], 1)
    (both,) = pictures([Scene((planned,))], 1)
    assert max(plan_pixels(alone)) < 10
    assert min(plan_pixels(below_the_caption(both))) > 100


@needs_renderer
def test_pictures_say_what_they_show(go2):
    """The time that stands on them changes, and a track of one's own replaces it."""
    take = take_of_motion("a", synthetic_motion(seconds=0.8), go2)
    corners = [ink(picture) for picture in pictures([Scene((take,))], 25)]
    assert (corners[0] == corners[7]).all()
    assert (corners[7] != corners[8]).any()
    said = ((0.0, Caption("b")), (0.5, Caption("c", (), True)))
    own = list(pictures([Scene((take,), track=said)], 25))
    assert (ink(own[0]) != corners[0]).any()
    assert (ink(own[0]) == ink(own[12])).all()
    orange = (own[16][:60].astype(int)[..., 0] - own[16][:60, :, 2]) > 150
    assert orange.sum() > 100


def ink(picture):
    """Returns where the text's dark ink is, above the floor and on it."""
    return (picture[:60, :200] < 80).all(axis=-1)


def test_a_machine_that_cannot_render_is_told_what_it_lacks(monkeypatch):
    def missing(name):
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(rendering.sys, "platform", "linux")
    monkeypatch.setattr(rendering.ctypes, "CDLL", missing)
    with pytest.raises(OSError, match="apt-get install libegl1"):
        make_engine()


@needs_renderer
@pytest.mark.skipif(find_spec("triton") is None, reason="PyTorch is without Triton")
def test_networks_are_loaded_after_pictures_are_made():
    """Mesa's LLVM and Triton's crash a process that loads them in this order."""
    script = """
from tests.synthetic_motion import synthetic_motion
from loco_drake.models.robots import get_robot
from loco_drake.viewing.replay import pictures
from loco_drake.viewing.takes import Scene, take_of_motion
take = take_of_motion("a", synthetic_motion(seconds=0.2), get_robot("go2"))
assert list(pictures([Scene((take,))], 1))
import vector_quantize_pytorch
"""
    run_python("-c", script, cwd=Path(__file__).parents[2])
