from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.rotations import quat_multiply, quat_rotate, yaw_of, yaw_quat
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.viewing.takes import one_by_one, side_by_side, take_of_motion
from tests.synthetic_motion import synthetic_motion


def test_a_take_begins_at_the_origin_and_heads_ahead(go2):
    """However the file was turned and moved; heights, joints and steps stay."""
    motion = synthetic_motion(seconds=1.0, turn=0.5)
    turn, shift = yaw_quat(np.array(2.0)), np.array([5.0, -7.0, 0.0])
    moved = replace(
        motion,
        base_position=quat_rotate(turn, motion.base_position) + shift,
        base_quaternion=quat_multiply(turn, motion.base_quaternion),
    )
    plain, take = (take_of_motion("a", m, go2) for m in (motion, moved))
    np.testing.assert_allclose(take.q, plain.q, atol=1e-9)
    np.testing.assert_allclose(take.q[0, 4:6], 0, atol=1e-12)
    assert yaw_of(take.q[0, :4]) == pytest.approx(0, abs=1e-9)
    np.testing.assert_array_equal(take.q[:, 7:], motion.joint_positions)
    np.testing.assert_allclose(take.q[:, 6], motion.base_position[:, 2])


def test_a_clip_is_shown_to_the_left_at_the_rate_of_the_motion(go2):
    time = np.arange(61) / 60
    ahead = np.stack((0.8 * time, 0 * time, 0 * time + 0.4), axis=-1)
    toes = np.repeat(ahead[:, None], 4, axis=1)
    clip = KeypointClip("dog", "trot", 60.0, ahead, ahead, toes, {})
    take = take_of_motion("a", synthetic_motion(seconds=1.0), go2, clip)
    assert take.points.shape == (51, 6, 3)
    away = take.points - take.q[:, None, 4:7]
    np.testing.assert_allclose(away[..., 0], 0, atol=0.02)
    assert (away[..., 1] > 2 * go2.stand_height).all()


def test_takes_beside_each_other_keep_their_distance_and_the_longest_counts(go2):
    slow = take_of_motion("a", synthetic_motion(seconds=1.0, speed=0.4), go2)
    fast = take_of_motion("b", synthetic_motion(seconds=2.0, speed=0.8), go2)
    scene = side_by_side([slow, fast])
    assert len(scene) == 101
    assert scene.duration == 2.0
    first, second = scene.takes
    # The first on the right, both as far from the middle.
    np.testing.assert_allclose(first.q[0, 5], -second.q[0, 5])
    assert first.q[0, 5] < -go2.stand_height
    np.testing.assert_allclose(scene.middle(0.0), 0, atol=1e-12)
    # At first as fast as both are on average, then as the one that goes on.
    np.testing.assert_allclose(scene.middle(1.0), [0.6, 0.0], atol=0.01)
    np.testing.assert_allclose(scene.middle(2.0), [1.4, 0.0], atol=0.01)
    np.testing.assert_array_equal(scene.middle(9.0), scene.middle(2.0))


def test_the_middle_of_one_take_is_its_base(go2):
    take = take_of_motion("a", synthetic_motion(seconds=1.0, turn=1.0), go2)
    (scene,) = one_by_one([take])
    for time in (0.0, 0.5, 1.0):
        base = take.q[take.index(time), 4:6]
        np.testing.assert_allclose(scene.middle(time), base, atol=1e-12)


def test_a_change_of_gait_is_told_for_two_seconds(go2):
    motion = synthetic_motion(seconds=4.0, speed=0.5, turn=0.2)
    changes = ((0, parse_label("dog-pace")), (50, parse_label("mpc-trot")))
    (scene,) = one_by_one(
        [take_of_motion("a", replace(motion, gait_changes=changes), go2)]
    )
    told = {time: scene.caption(time) for time in (0.0, 0.98, 1.0, 3.0, 3.02, 4.0)}
    assert [(c.title, c.marked) for c in told.values()] == [
        ("dog-pace  a", False),
        ("dog-pace  a", False),
        ("dog-pace → mpc-trot  a", True),
        ("dog-pace → mpc-trot  a", True),
        ("mpc-trot  a", False),
        ("mpc-trot  a", False),
    ]
    assert told[3.02].lines == ("3.02 s  0.50 m/s",)
