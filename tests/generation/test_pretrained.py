import json
import time

import numpy as np
import pytest
import torch

from loco_drake.cli.generate import Generate
from loco_drake.errors import InputError
from loco_drake.gaits import parse_label
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.pretrained import (
    pretrained_motion_model,
    pretrained_path,
)
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.motion import load_motion
from loco_drake.motion_quality import (
    joint_speed_ratio_max,
    penetration_max,
    stance_slip_median,
    toe_trajectories,
)


def test_weights_are_small():
    for name in ("tokenizer", "generator"):
        assert pretrained_path(name).stat().st_size < 5e6


# Between which speeds, in m/s, each gait is to be on average.
SPEEDS = {
    "dog-pace": (0.4, 1.0),
    "dog-trot": (0.8, 1.8),
    "dog-gallop": (1.5, 3.0),
    "horse-walk": (0.3, 0.45),
    "horse-trot": (0.5, 0.8),
    "mpc-trot": (1.0, 1.8),
    "mpc-bound": (0.4, 1.5),
    "mpc-gallop": (1.5, 3.2),
    "mpc-crawl": (0.3, 1.1),
    "solo8-trot": (0.2, 1.2),
    "solo8-bound": (0.1, 1.5),
    "solo8-walk": (0.3, 1.3),
    "solo8-crawl": (0.3, 1.5),
    "solo8-stilt": (0.3, 1.2),
    "solo8-wave": (0.4, 1.3),
}


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("label", SPEEDS)
def test_shipped_weights_write_motion_that_can_be_walked(name, label):
    """Speed and height of the gait, feet that neither slip nor sink, and no fall."""
    robot, (slowest, fastest) = get_robot(name), SPEEDS[label]
    model = pretrained_motion_model(name)
    motions = generate_motions(model, parse_label(label), 6.0, [0, 1, 2])
    for motion in motions:
        p_WF = toe_trajectories(motion, robot)
        assert stance_slip_median(p_WF, robot.foot_radius, 50.0) < 0.03
        assert penetration_max(p_WF, robot.foot_radius) < 1e-3
        height = motion.base_position[:, 2]
        assert 0.11 < height.min() < height.max() < 0.45
        upright = 1 - 2 * (motion.base_quaternion[:, 1:3] ** 2).sum(axis=1)
        assert upright.min() > 0.8
        assert (motion.joint_positions >= robot.joint_lower - 1e-9).all()
        assert (motion.joint_positions <= robot.joint_upper + 1e-9).all()
        assert joint_speed_ratio_max(motion.joint_positions, robot, 50.0) < 1.2
    speeds = [np.linalg.norm(m.base_velocity[:, :2], axis=1).mean() for m in motions]
    assert slowest < np.mean(speeds) < fastest


def test_pairs_of_legs_of_the_gaits():
    """In a pace the legs of a side swing together, in a trot diagonal ones do."""
    model = pretrained_motion_model("go2")
    for label, partner in (("dog-pace", 2), ("dog-trot", 3)):
        (motion,) = generate_motions(model, parse_label(label), 6.0, [0])
        thighs = motion.joint_positions[:, 1::3]
        with_fl = np.corrcoef(thighs.T)[0]
        assert with_fl[partner] == max(with_fl[1:])
        assert with_fl[partner] > 0.4


def test_a_second_for_one_robot_takes_a_fraction_of_it():
    """A loose bound: machines differ, and tests share theirs."""
    model = pretrained_motion_model("go2")
    stream = model.start(np.array([0]))
    label = np.array([parse_label("dog-trot").index])
    stream, _ = model.extend(stream, label)
    start = time.process_time()
    for _ in range(5):
        stream, frames = model.extend(stream, label)
    seconds = 5 * frames.q.shape[1] / 50
    assert (time.process_time() - start) / seconds < 0.2


def test_the_command_writes_motions_and_figures(tmp_path):
    command = Generate(
        gait="dog-pace",
        duration=2.0,
        count=2,
        seed=7,
        out=tmp_path / "out",
        json=tmp_path / "figures.json",
    )
    assert command.run() == 0
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["count"] == 2
    assert figures["frames_per_second"] == pytest.approx(
        4 * figures["tokens_per_second"]
    )
    paths = sorted((tmp_path / "out").iterdir())
    assert [path.name for path in paths] == ["dog-pace-7.npz", "dog-pace-8.npz"]
    motion = load_motion(paths[1])
    assert len(motion) == 101
    (again,) = generate_motions(
        pretrained_motion_model("go2"), parse_label("dog-pace"), 2.0, [8]
    )
    np.testing.assert_allclose(again.joint_positions, motion.joint_positions, atol=1e-4)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gait": "dog-canter"}, "Unknown gait"),
        ({"robot": "spot"}, "Unknown robot 'spot'; the choices are go2, a1"),
        ({"duration": 0.0}, "above 0"),
        ({"duration": float("inf")}, "above 0"),
        ({"count": 0}, "--count"),
        ({"seed": -1}, "--seed"),
        ({"temperature": float("nan")}, "temperature"),
        ({"top_p": 1.5}, "top_p"),
    ],
)
def test_bad_options_are_refused(options, message, tmp_path):
    with pytest.raises(InputError, match=message):
        Generate(**{"out": tmp_path, **options}).run()
    assert not list(tmp_path.iterdir())


def test_missing_weights_are_named(tmp_path):
    with pytest.raises(InputError, match=r"no tokenizer weights at .*nowhere"):
        Generate(out=tmp_path, tokenizer=tmp_path / "nowhere.safetensors").run()


def test_loading_leaves_torch_as_it_was():
    threads, state = torch.get_num_threads(), torch.get_rng_state()
    generate_motions(pretrained_motion_model("go2"), parse_label("dog-pace"), 1.0, [0])
    assert torch.get_num_threads() == threads
    assert torch.equal(torch.get_rng_state(), state)
