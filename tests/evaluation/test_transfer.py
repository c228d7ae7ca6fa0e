from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.evaluation.tokenizer import pair_up, transfer_rmse
from loco_drake.generation.features import JOINTS, motion_features
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig
from loco_drake.models.robots import get_robot
from tests.robot_files import OWN
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def tokenizer():
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        config = TokenizerConfig(robots=("a1", "go2"), width=16, frame_width=8)
        tokenizer = Tokenizer(config)
        tokenizer.codebooks.normal_()
    return tokenizer.eval()


def test_what_the_other_robot_would_do_is_compared(tokenizer):
    """Wanted is what is decoded, off by .1 rad in three joints of twelve: .05 rad."""
    motion = synthetic_motion(seconds=2.0, name="go2")
    features = motion_features(get_robot("go2"), motion)[None, :100]
    with torch.inference_mode():
        codes = tokenizer.encode(
            torch.tensor(features, dtype=torch.float32), torch.tensor([1])
        )
        decoded = tokenizer.decode(codes, torch.tensor([0]))[0, :, JOINTS].numpy()
    other = synthetic_motion(seconds=2.0, name="a1")
    joints = other.joint_positions.copy()
    joints[:100] = decoded
    pair = (motion, replace(other, joint_positions=joints.copy()))
    assert transfer_rmse(tokenizer, [pair]) == pytest.approx(0.0, abs=1e-6)
    joints[:, [0, 4, 11]] += 0.1
    off = (motion, replace(other, joint_positions=joints))
    assert transfer_rmse(tokenizer, [off]) == pytest.approx(0.05, rel=1e-4)
    mean = np.sqrt(0.05**2 / 2)
    assert transfer_rmse(tokenizer, [pair, off]) == pytest.approx(mean, rel=1e-4)


def test_joints_of_another_build_are_compared_as_its_own():
    """ANYmal's rear knees point forward: what is decoded are legs as the Go2's."""
    robot = get_robot(str(OWN["anymal"]))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        config = TokenizerConfig(
            robots=("go2", "anymal"), added=("anymal",), bodies=("anymal",), width=16
        )
        tokenizer = Tokenizer(config)
        tokenizer.codebooks.normal_()
    motion = synthetic_motion(seconds=2.0, name="go2")
    features = motion_features(get_robot("go2"), motion)[None, :100]
    with torch.inference_mode():
        given = torch.tensor(features, dtype=torch.float32)
        codes = tokenizer.encode(given, torch.tensor([0]))
        angles = tokenizer.decode(codes, torch.tensor([1]))[0, :, JOINTS].numpy()
    other = synthetic_motion(seconds=2.0, name="anymal")
    joints = other.joint_positions.copy()
    joints[:100] = robot.joints_of_backward(angles)
    assert np.abs(joints[:100] - angles).max() > 0.5
    pair = (motion, replace(other, joint_positions=joints))
    assert transfer_rmse(tokenizer, [pair]) == pytest.approx(0.0, abs=1e-5)


def test_pairs_are_of_the_same_stretch():
    def stretch(name, file, frames):
        motion = synthetic_motion(seconds=1.0, name=name)
        return replace(motion, provenance={"file": file, "frames": frames})

    given = [stretch("go2", "a.txt", "0-90"), stretch("go2", "a.txt", "90-200")]
    wanted = [stretch("a1", "b.txt", "0-90"), stretch("a1", "a.txt", "0-90")]
    assert pair_up(given, wanted) == [(given[0], wanted[1])]
    assert pair_up(given, []) == []
