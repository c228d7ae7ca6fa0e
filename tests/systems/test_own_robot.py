"""From a made dog to torques, of robots that are only a file: B1 and ANYmal."""

import json

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from loco_drake.cli.main import main
from loco_drake.control.actor_file import load_actor
from loco_drake.control.plan import plan_from_motion
from loco_drake.control.state import has_fallen, split
from loco_drake.generation import features as ft
from loco_drake.models.robots import get_robot, load_robot
from loco_drake.motion.momentum import positions
from loco_drake.motion.motion_file import load_motion, save_motion
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import ExternalAction, MotionReference, Scenario
from loco_drake.systems.simulator import StartEpisode
from tests.retargeting.test_other_robot import dog_clip
from tests.robot_files import OWN, without_weights


@pytest.fixture(scope="module", params=tuple(OWN))
def robot(request):
    return get_robot(str(OWN[request.param]))


@pytest.fixture(scope="module")
def motion(robot):
    """A dog's trot as the command retargets it, by the chains of the URDF."""
    motion, report = retarget_clip(dog_clip("trot"), load_robot(robot.definition))
    assert report.warnings == ()
    return motion.slice(50, 150)


@pytest.fixture(scope="module")
def folder(motion, tmp_path_factory):
    folder = tmp_path_factory.mktemp("motions")
    save_motion(motion, folder / "trot.npz")
    return folder


def test_its_files_are_checked_as_go2_s_are(motion, folder):
    np.testing.assert_array_equal(
        load_motion(folder / "trot.npz").joint_positions, motion.joint_positions
    )


def test_features_are_of_legs_that_are_built_alike(robot, motion):
    """Of all robots calves bend backward; the way back is exact."""
    features = ft.motion_features(robot, motion)
    assert (features[:, ft.JOINTS][:, 2::3] < 0).all()
    path = np.zeros((len(motion), 3))
    q = ft.positions(robot, features, path)
    np.testing.assert_allclose(q[:, 7:], motion.joint_positions, atol=1e-9)


def test_closed_form_stays_where_retargeting_put_the_feet(robot, motion):
    toes = robot.toe_positions(motion.joint_positions)
    found = robot.nearest_joints(toes)
    np.testing.assert_allclose(found, motion.joint_positions, atol=1e-6)
    assert positions(motion).shape == (len(motion), 19)


def test_set_points_alone_keep_it_on_its_feet_for_a_second(robot, motion, folder):
    """Whatever a policy adds; the same diagram as Go2's and A1's."""
    scenario = Scenario(
        robot=robot.definition,
        reference=MotionReference(path=folder / "trot.npz"),
        policy=ExternalAction(),
    )
    diagram = MakeLocomotionDiagram(scenario)
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("action").FixValue(context, np.zeros(12))
    StartEpisode(simulator)
    simulator.AdvanceTo(1.0)
    state = diagram.GetOutputPort("state").Eval(context)
    q, _ = split(state)
    assert not has_fallen(robot, q)
    plan = plan_from_motion(robot, motion)
    assert q[4] - plan.q[0, 4] > 0.2 * (motion.base_position[50, 0] - plan.q[0, 4])


@pytest.mark.slow
def test_a_tracker_is_trained_simulated_and_exported(robot, folder, tmp_path, capsys):
    """One batch, of what loco-drake's commands are given as --robot FILE."""
    pytest.importorskip("onnxscript")
    out, name = tmp_path / "run", robot.definition
    options = f"--robot {name} --motions {folder} --steps 64 --batch 64 --workers 1"
    assert main(["train", "tracker", *options.split(), "--out", str(out)]) == 0
    policy = out / "policy.safetensors"
    assert load_actor(policy, robot).config.robot == robot.name
    options = f"--robot {name} --reference {folder / 'trot.npz'} --policy {policy}"
    options += f" --no-meshcat --duration .4 --json {tmp_path / 'figures.json'}"
    assert main(["simulate", *options.split()]) == 0
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert (figures["robot"], figures["fell"]) == (robot.name, False)
    options = f"--robot {name} --policy {policy} --onnx {tmp_path / 'policy.onnx'}"
    assert main(["export", *options.split()]) == 0
    assert (tmp_path / "policy.onnx").is_file()
    capsys.readouterr()
    bare = without_weights(robot.name, tmp_path)
    options = f"--robot {bare} --reference {folder / 'trot.npz'} --no-meshcat"
    assert main(["simulate", *options.split()]) == 2
    said = capsys.readouterr().err
    assert f"There are no policy weights for {robot.name} yet" in said
    assert "loco-drake train tracker" in said


def test_generated_motion_needs_a_tokenizer_that_knows_the_body(
    robot, capsys, tmp_path
):
    bare = without_weights(robot.name, tmp_path)
    assert main(["generate", "--robot", str(bare)]) == 2
    said = capsys.readouterr().err
    assert f"not for the robot '{robot.name}'" in said
    assert "loco-drake train tokenizer --add-to" in said
