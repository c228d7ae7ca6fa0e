import numpy as np
import pytest
from pydrake.geometry import Meshcat, Role

from loco_drake.common.rotations import quat_rotate
from loco_drake.models.legs import LEGS
from loco_drake.models.robots import load_robot
from loco_drake.viewing.rendering import FIELD_OF_VIEW, HEIGHT, WIDTH
from loco_drake.viewing.stage import Stage, viewpoint
from loco_drake.viewing.takes import one_by_one, side_by_side, take_of_motion
from tests.robot_files import SOLO8
from tests.synthetic_motion import synthetic_motion
from tests.viewing.motions import swinging


def places(stage, name):
    """Returns where geometries whose names end in ``name`` are, m, shape (N, 3)."""
    query = stage.query_object
    inspector = query.inspector()
    found = [
        query.GetPoseInWorld(geometry).translation()
        for geometry in inspector.GetAllGeometryIds(Role.kIllustration)
        if inspector.GetName(geometry).endswith(name)
    ]
    return np.array(found)


def test_toes_of_a_robot_from_a_file_are_where_its_kinematics_says():
    """Its figure of sticks is drawn by Drake's model, not by those."""
    solo8 = load_robot(str(SOLO8))
    take = take_of_motion("a", swinging(solo8), solo8)
    stage = Stage(one_by_one([take]))
    for k in (0, 3):
        stage.set_up(stage.scenes[0], k / take.fps)
        q = take.q[k]
        expected = q[4:7] + quat_rotate(q[:4], solo8.toe_positions(q[7:]))
        toes = np.concatenate([places(stage, f"{leg}_toe") for leg in LEGS])
        np.testing.assert_allclose(toes, expected, atol=1e-9)


def test_the_camera_follows_and_the_floor_steps_by_its_pattern(go2):
    take = take_of_motion("a", synthetic_motion(seconds=5.0, speed=1.5), go2)
    stage = Stage(one_by_one([take]))
    steps = set()
    for time in np.arange(0.0, 5.0, 0.25):
        stage.set_up(stage.scenes[0], time)
        (floor,) = places(stage, "floor")
        base = take.q[take.index(time), 4:6]
        # In the world, of which the base is in the middle, tiles stay where they are.
        step = floor[:2] + base
        np.testing.assert_allclose(step, 5.0 * np.round(step / 5.0), atol=1e-9)
        assert np.abs(floor[:2]).max() <= 2.5
        steps.add(round(step[0]))
    assert steps == {0, 5}


def test_only_the_robots_of_a_scene_are_seen(go2):
    """One figure serves all scenes of its robot."""
    solo8 = load_robot(str(SOLO8))
    takes = [
        take_of_motion("a", synthetic_motion(seconds=1.0), go2),
        take_of_motion("b", swinging(solo8), solo8),
        take_of_motion("c", synthetic_motion(seconds=1.0), go2),
    ]
    stage = Stage(one_by_one(takes))
    assert len(places(stage, "FL_toe")) == 1
    for number, scene in enumerate(stage.scenes):
        stage.set_up(scene, 0.0)
        (toe,) = places(stage, "FL_toe")
        assert (toe[2] > 0) == (number == 1)
    beside = Stage((side_by_side(takes),))
    beside.set_up(beside.scenes[0], 0.0)
    assert (places(beside, "FL_toe")[:, 2] > 0).all()


@pytest.mark.parametrize("count", [1, 2, 4, 8])
def test_all_robots_are_in_the_picture_and_as_near_as_can_be(go2, count):
    take = take_of_motion("a", synthetic_motion(seconds=1.0), go2)
    scene = side_by_side([take] * count)
    eye, target = viewpoint((scene,))
    across = np.tan(FIELD_OF_VIEW / 2) * np.array([WIDTH / HEIGHT, 1.0])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    shares = []
    for shown in scene.takes:
        corners = shown.q[0, 4:7] + np.array(
            [[x, 0.0, z] for x in (-0.3, 0.3) for z in (-0.3, 0.15)]
        )
        away = corners - eye
        sides = np.stack((away @ right, away @ np.cross(right, forward)), axis=-1)
        shares.append(np.abs(sides / (away @ forward)[:, None] / across).max())
    assert 0.3 < max(shares) < 1.0


def test_meshcat_shows_the_robot_at_the_same_paths_as_a_simulation_does(go2):
    meshcat = Meshcat()
    take = take_of_motion("a", synthetic_motion(seconds=1.0), go2)
    stage = Stage(one_by_one([take]), meshcat)
    stage.draw(stage.scenes[0], 0.0)
    for path in ("figure0/go2/FL_calf", "ground/floor"):
        assert meshcat.HasPath(f"/drake/illustration/{path}")
