"""What a robot did with a motion, as motion."""

import json
from dataclasses import replace

import numpy as np
import pytest
import tyro

from loco_drake.cli.record import Record
from loco_drake.common.errors import InputError
from loco_drake.control.actor_file import load_actor
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import policy_path
from loco_drake.motion import quality
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.momentum import momentum_error
from loco_drake.motion.motion import FPS
from loco_drake.motion.motion_file import load_motion, save_motion
from loco_drake.tracking.recording import record
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def robot():
    return get_robot("go2")


@pytest.fixture(scope="module")
def actor(robot):
    return load_actor(policy_path(robot, None), robot)


@pytest.fixture(scope="module")
def trot():
    return synthetic_motion("dog-trot", 2.0, speed=0.8)


@pytest.fixture(scope="module")
def recording(robot, actor, trot):
    return record(robot, actor, trot, attempts=2)


def test_recording_is_the_motion_as_the_robot_made_it(robot, trot, recording):
    """Near to it, with toes that stand where they touch down, within all limits."""
    made = recording.motion
    assert 75 < recording.normalized_return < 100
    assert (made.label, made.fps, made.robot) == (trot.label, FPS, "go2")
    frames = min(len(made), len(trot))
    assert abs(len(made) - len(trot)) < 10
    apart = made.joint_positions[:frames] - trot.joint_positions[:frames]
    assert 0.005 < np.sqrt((apart**2).mean()) < 0.2
    p_WF = quality.toe_trajectories(made, robot)
    assert quality.stance_slip_median(p_WF, robot.foot_radius, FPS) < 0.002
    assert quality.penetration_max(p_WF, robot.foot_radius) < 0.002
    assert quality.joint_limit_violations(made.joint_positions, robot) == 0
    assert quality.joint_speed_ratio_max(made.joint_positions, robot, FPS) <= 1
    steps = np.diff(p_WF, axis=0)[made.contacts[1:] & made.contacts[:-1]]
    assert np.abs(steps).max() < 1e-3


def test_same_seed_same_recording(robot, actor, trot, recording):
    again = record(robot, actor, trot, attempts=2)
    assert again.normalized_return == recording.normalized_return
    np.testing.assert_array_equal(
        again.motion.joint_positions, recording.motion.joint_positions
    )


def test_what_no_robot_can_do_is_not_recorded(robot, actor, trot):
    """A trot half a metre over the ground."""
    up = np.array([0.0, 0.0, 0.5])
    above = replace(trot, base_position=trot.base_position + up)
    assert record(robot, actor, above, attempts=1) is None


def test_motion_of_several_gaits_is_refused(robot, actor, trot):
    changes = ((0, parse_label("dog-trot")), (40, parse_label("dog-pace")))
    with pytest.raises(InputError, match="several gaits"):
        record(robot, actor, replace(trot, gait_changes=changes))


def test_command_writes_what_went_well(robot, trot, tmp_path, capsys):
    """Grounded, with what it is worth in its provenance; the rest is left out."""
    save_motion(trot, tmp_path / "good.npz")
    options = ("--motions", tmp_path, "--out", tmp_path / "out", "--attempts", 1)

    def command(*more):
        arguments = [str(each) for each in (*options, *more)]
        return tyro.cli(Record, args=arguments).run()

    assert command("--json", tmp_path / "a.json") == 0
    figures = json.loads((tmp_path / "a.json").read_text())["good"]
    made = load_motion(tmp_path / "out" / "good.npz")
    assert momentum_error(made, robot) == pytest.approx(figures["momentum_error"])
    assert figures["momentum_error"] < 0.3 * figures["momentum_error_before"]
    assert made.grounded
    assert "of 100" in made.provenance["recorded"]
    # The title is wrapped at the width of a short table.
    assert "1 of 1" in " ".join(capsys.readouterr().out.split())
    # Left out, and without grounding.
    assert command("--least-return", 100) == 1
    assert command("--no-ground", "--out", tmp_path / "plain") == 0
    assert not load_motion(tmp_path / "plain" / "good.npz").grounded
    with pytest.raises(InputError, match="no folder of Motion files"):
        tyro.cli(Record, args=["--motions", str(tmp_path / "none")]).run()
