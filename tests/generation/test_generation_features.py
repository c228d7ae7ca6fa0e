import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.generation import features as ft
from loco_drake.models.robots import get_robot
from tests.generation.paths import integrate_path

GO2 = get_robot("go2")


def pose_of(motion, index):
    w, x, y, z = motion.base_quaternion[index]
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.array([*motion.base_position[index, :2], yaw])


@pytest.mark.parametrize("turn", [0.0, 1.5, -4.0])
def test_round_trip_gives_back_every_pose(make_synthetic, turn):
    """-4 rad/s for 3 s passes through more than a whole turn."""
    motion = make_synthetic("dog-trot", 3.0, 0.8, turn)
    features = ft.motion_features(GO2, motion)
    start = pose_of(motion, 0)
    path = integrate_path(GO2, features[1:], start)
    q = ft.positions(GO2, features[1:], path)
    np.testing.assert_allclose(q[:, 4:7], motion.base_position[1:], atol=1e-12)
    np.testing.assert_allclose(q[:, 7:], motion.joint_positions[1:], atol=0)
    # q and -q are the same rotation.
    dots = np.abs((q[:, :4] * motion.base_quaternion[1:]).sum(axis=-1))
    np.testing.assert_allclose(dots, 1.0, atol=1e-12)


def test_features_do_not_depend_on_place_and_heading(make_synthetic):
    from dataclasses import replace

    from loco_drake.common.rotations import quat_multiply, quat_rotate, yaw_quat

    motion = make_synthetic("dog-pace", 2.0, 0.7, 0.4)
    q_turn, shift = yaw_quat(np.array(2.1)), np.array([3.0, -1.0, 0.0])
    moved = replace(
        motion,
        base_position=quat_rotate(q_turn, motion.base_position) + shift,
        base_quaternion=quat_multiply(q_turn, motion.base_quaternion),
    )
    np.testing.assert_allclose(
        ft.motion_features(GO2, moved), ft.motion_features(GO2, motion), atol=1e-12
    )


def test_velocity_and_yaw_rate_of_an_arc(make_synthetic):
    """0.8 m/s on a Go2 of known stand height, 0.5 rad/s to the left."""
    motion = make_synthetic("dog-trot", 2.0, 0.8, 0.5)
    features = ft.motion_features(GO2, motion)
    np.testing.assert_allclose(
        features[:, 0] * GO2.stand_height, 0.8, rtol=1e-4
    )  # a chord is that much shorter than its arc
    np.testing.assert_allclose(features[:, ft.YAW_RATE], 0.5, atol=1e-9)
    height = features[:, ft.HEIGHT] * GO2.stand_height
    np.testing.assert_allclose(height[:, 0], motion.base_position[:, 2])


def test_integration_goes_on_where_it_stopped(make_synthetic):
    features = ft.motion_features(GO2, make_synthetic("dog-trot", 2.0, 0.8, 1.0))
    start = np.array([1.0, 2.0, 0.3])
    whole = integrate_path(GO2, features, start)
    first = integrate_path(GO2, features[:37], start)
    second = integrate_path(GO2, features[37:], first[-1])
    np.testing.assert_allclose(np.concatenate((first, second)), whole, atol=1e-12)


def test_motion_of_another_robot_is_refused(make_synthetic):
    with pytest.raises(InputError, match="not of a1"):
        ft.motion_features(get_robot("a1"), make_synthetic())


def test_toes_in_torch_agree_with_numpy_kinematics(make_synthetic):
    import torch

    from loco_drake.common.rotations import quat_rotate
    from loco_drake.generation.tokenizer_score import Toes

    motion = make_synthetic("dog-pace", 1.0, 0.7, 0.0)
    features = ft.motion_features(GO2, motion)
    features[:, ft.ROLL_PITCH] = [0.2, -0.3]
    q = ft.positions(GO2, features, np.zeros((len(motion), 3)))
    expected = quat_rotate(q[:, None, :4], GO2.toe_positions(q[:, 7:]))
    expected += q[:, None, 4:7]
    toes = Toes(["a1", "go2"])
    batch = torch.tensor(features[None], dtype=torch.float32)
    p_HF = toes.positions(batch, torch.tensor([1]))
    np.testing.assert_allclose(p_HF[0].numpy(), expected, atol=1e-6)


def test_toe_speeds_of_standing_feet_are_zero(make_synthetic):
    """The made motion has no slip: its feet in contact stand still over the ground."""
    import torch

    from loco_drake.generation.tokenizer_score import Toes

    motion = make_synthetic("dog-trot", 2.0, 0.8, 0.0)
    features = ft.motion_features(GO2, motion)
    toes, robot = Toes(["go2"]), torch.tensor([0])
    batch = torch.tensor(features[None], dtype=torch.float32)
    v = toes.velocities(batch, toes.positions(batch, robot), robot)[0].numpy()
    standing = motion.contacts[1:] & motion.contacts[:-1]
    speed = np.linalg.norm(v, axis=-1)
    assert speed[standing].max() < 1e-3
    assert speed[~standing].mean() > 0.5
