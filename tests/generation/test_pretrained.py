import hashlib
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open

from loco_drake.cli.generate import Generate
from loco_drake.common.errors import InputError
from loco_drake.common.rotations import yaw_of
from loco_drake.evaluation.gait_change import forward_speed, roughness
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.generator import Generator
from loco_drake.generation.motion_model import MotionModel, pretrained_motion_model
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.motion.gaits import parse_label, parse_schedule
from loco_drake.motion.momentum import momentum_error
from loco_drake.motion.motion_file import load_motion
from loco_drake.motion.quality import (
    joint_speed_ratio_max,
    penetration_max,
    stance_slip_median,
    toe_trajectories,
)
from tests.process import run_python


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


@pytest.mark.parametrize("label", ["dog-pace", "horse-walk", "solo8-trot"])
def test_a_faster_pace_is_faster_and_is_kept(label):
    """Speeds rise with the rank, and a motion stays within those of its label."""
    model = pretrained_motion_model("go2")
    speeds = []
    for rank in (0.05, 0.5, 0.95):
        motions = generate_motions(
            model, parse_label(label), 8.0, range(4), speed_rank=rank
        )
        speeds.append(np.mean([forward_speed(model.robot, m) for m in motions]))
    edges = model.generator.speed_edges[parse_label(label).index].numpy()
    edges = edges.astype(float) * model.robot.stand_height
    assert speeds[0] < speeds[1] < speeds[2]
    assert speeds[0] < edges[6]
    assert edges[4] < speeds[1] < edges[10]
    assert edges[8] < speeds[2]


# Of the generator's tensors without those that learned to be told velocities, before
# these learned: what it writes without being told is what it wrote then.
UNTOLD = "275bc80ff7dd8dd78675a15fa1564ab9fd160483ab40788995e100bbb406cbe1"


def test_learning_to_be_told_changed_nothing_else():
    digest = hashlib.sha256()
    with safe_open(pretrained_path("generator"), "np") as file:
        names = [n for n in sorted(file.keys()) if not n.startswith("telling.")]
        for name in names:
            value = file.get_tensor(name)
            text = f"{name} {value.dtype} {value.shape}"
            digest.update(text.encode() + value.tobytes())
    assert len(names) == 86
    assert digest.hexdigest() == UNTOLD


def test_without_being_told_it_writes_as_a_network_that_cannot_be():
    """To the last bit."""
    model = pretrained_motion_model("go2")
    plain = Generator(replace(model.generator.config, told=False))
    plain.load_state_dict(model.generator.state_dict(), strict=False)
    untold = MotionModel(model.tokenizer, plain, "go2")
    for label in ("dog-pace", "mpc-bound"):
        a, b = (
            generate_motions(m, parse_label(label), 2.0, [3])[0]
            for m in (model, untold)
        )
        np.testing.assert_array_equal(a.joint_positions, b.joint_positions)
        np.testing.assert_array_equal(a.base_position, b.base_position)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_pace_turns_as_it_is_told(name):
    """By .7 rad/s to each side, within a third; untold it goes straight on average."""
    model = pretrained_motion_model(name)
    for turn in (-0.7, 0.7):
        motions = generate_motions(
            model, parse_label("dog-pace"), 6.0, range(4), velocity=[0.6, 0.0, turn]
        )
        yaws = [np.unwrap(yaw_of(m.base_quaternion))[100:] for m in motions]
        rates = [(yaw[-1] - yaw[0]) / (len(yaw) - 1) * 50 for yaw in yaws]
        assert np.mean(rates) == pytest.approx(turn, rel=0.33)


@pytest.mark.parametrize(
    ("label", "speeds"), [("mpc-trot", (1.2, 1.7)), ("solo8-trot", (0.4, 1.0))]
)
def test_gaits_go_as_fast_as_they_are_told(label, speeds):
    model = pretrained_motion_model("go2")
    for speed in speeds:
        motions = generate_motions(
            model, parse_label(label), 6.0, range(4), velocity=[speed, 0.0, 0.0]
        )
        found = [forward_speed(model.robot, m)[100:].mean() for m in motions]
        assert np.mean(found) == pytest.approx(speed, abs=0.1)


# Greatest acceleration about a change, over that of the gaits themselves: to brake from
# 1.5 m/s to .4 takes more than an even trot and a walk do.
CHANGES = {
    "dog-pace,dog-trot@4,dog-gallop@8": 1.1,
    "mpc-crawl,mpc-trot@4,horse-walk@8": 2.0,
}


@pytest.mark.parametrize("text", CHANGES)
def test_gaits_change_without_a_jump_and_within_a_second(text):
    """Steps and accelerations are those of the gaits, and so is the speed soon after.

    The speed from one second after a change on is as near to that of the new gait as
    motions of the gait are to each other, and a quarter of what the gaits differ by.
    """
    model, schedule = pretrained_motion_model("go2"), parse_schedule(text)
    seeds = range(6)
    steady = {
        label: generate_motions(model, label, 8.0, seeds) for label in schedule.labels
    }
    motions = generate_motions(model, schedule, 12.0, seeds)
    speeds = {
        label: [forward_speed(model.robot, m).mean() for m in own]
        for label, own in steady.items()
    }
    for before, after, start in zip(
        schedule.labels, schedule.labels[1:], schedule.starts[1:], strict=False
    ):
        usual = [*steady[before], *steady[after]]
        for motion in motions:
            rough = roughness(motion, start, usual)
            assert max(rough["joint_step_rad"], rough["base_step_m"]) <= 1.05
            assert max(rough.values()) <= CHANGES[text]
        arrived = slice(round((start + 1) * 50), round((start + 4) * 50))
        reached = [forward_speed(model.robot, m)[arrived].mean() for m in motions]
        apart = abs(np.mean(speeds[after]) - np.mean(speeds[before]))
        near = 2 * np.std(speeds[after]) + 0.25 * apart
        assert abs(np.mean(reached) - np.mean(speeds[after])) <= near


def test_a_pace_is_a_trot_by_its_legs_a_second_after_the_change():
    """The left front leg swings with the left rear one, then with the right one."""
    schedule = parse_schedule("dog-pace,dog-trot@4")
    model = pretrained_motion_model("go2")
    for motion in generate_motions(model, schedule, 8.0, range(4)):
        thighs = motion.joint_positions[:, 1::3]
        for frames, partner in ((thighs[:200], 2), (thighs[250:], 3)):
            with_fl = np.corrcoef(frames.T)[0]
            assert with_fl[partner] == max(with_fl[1:])


THREADS = """
import hashlib, numpy as np, torch
from loco_drake.evaluation.gait_change import forward_speed, roughness
from loco_drake.motion.gaits import parse_schedule
from loco_drake.motion.gaits import parse_label
from loco_drake.generation.motion_model import pretrained_motion_model
torch.set_num_threads({threads})
model = pretrained_motion_model("go2")
stream = model.start(np.array([7]), 10.0)
digest = hashlib.sha256()
for label in ("dog-trot", "dog-trot", "solo8-stilt"):
    stream, frames = model.extend(stream, np.array([parse_label(label).index]))
    digest.update(stream.tokens.tobytes() + frames.q.tobytes())
assert torch.get_num_threads() == {threads}
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_processes_of_any_number_of_threads_write_the_same(tmp_path):
    """Tokens and frames, to the last bit; OpenMP has as many threads as torch."""
    printed = [
        run_python(
            "-c",
            THREADS.format(threads=threads),
            cwd=tmp_path,
            OMP_NUM_THREADS=str(threads),
            PYTHONPATH=str(Path(__file__).parents[2]),
        )
        for threads in (1, 2)
    ]
    assert printed[0] == printed[1]


@pytest.mark.slow
def test_tokens_do_not_depend_on_what_is_written_beside_them():
    """One motion alone, and among 2, 5 and 32 others, at any place."""
    model = pretrained_motion_model("go2")
    label = parse_label("horse-trot").index

    def written(seeds, chunks=3):
        stream, parts = model.start(np.array(seeds), 10.0), []
        for _ in range(chunks):
            stream, frames = model.extend(stream, np.full(len(seeds), label))
            parts.append((stream.tokens, frames))
        tokens = [part[:, -model.chunk_tokens :] for part, _ in parts]
        q = np.concatenate([frames.q for _, frames in parts], axis=1)
        return np.concatenate(tokens, axis=1), q

    tokens, q = written([3])
    for seeds in ([3, 9, 1], [8, 0, 5, 6, 2, 3], [*range(100, 132), 3]):
        others, others_q = written(seeds)
        place = seeds.index(3)
        np.testing.assert_array_equal(others[place], tokens[0])
        np.testing.assert_allclose(others_q[place], q[0], atol=1e-9)


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


def test_the_command_changes_the_gait_on_the_way(tmp_path):
    gait = "dog-pace,dog-trot@1"
    assert Generate(gait=gait, duration=2.0, out=tmp_path).run() == 0
    (path,) = tmp_path.iterdir()
    assert path.name == f"{gait}-0.npz"
    motion = load_motion(path)
    assert len(motion) == 101
    assert str(motion.label) == "several-gaits"
    assert motion.provenance["generated"] == f"{gait} for 2 s"


def test_grounded_motion_of_several_gaits(tmp_path):
    gait = "dog-pace,dog-trot@1"
    for name, ground in (("plain", False), ("grounded", True)):
        out = tmp_path / name
        assert Generate(gait=gait, duration=2.0, out=out, ground=ground).run() == 0
    plain, grounded = (
        load_motion(tmp_path / name / f"{gait}-0.npz") for name in ("plain", "grounded")
    )
    robot = get_robot("go2")
    assert momentum_error(grounded, robot) < 0.3 * momentum_error(plain, robot)
    # The generator learned from grounded motion; what it writes is nearly so.
    assert (plain.grounded, grounded.grounded) == (True, True)
    assert grounded.gait_changes == plain.gait_changes
    np.testing.assert_array_equal(grounded.contacts, plain.contacts)


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
        ({"tell": (0.5, float("inf"), 0.0)}, "three finite numbers"),
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
