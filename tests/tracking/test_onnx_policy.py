import json
import sys
from dataclasses import replace

import numpy as np
import onnxruntime
import pytest
import torch

from loco_drake.cli.main import main
from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import load_actor, make_actor, save_actor
from loco_drake.control.observation import OBSERVATION_LAYOUT, OBSERVATION_SIZE
from loco_drake.models.robots import get_robot
from loco_drake.tracking.onnx_policy import export_onnx, policy_metadata


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Actor, session and JSON file of an export by the command line."""
    folder = tmp_path_factory.mktemp("onnx")
    generator = torch.Generator().manual_seed(0)
    labels = ["dog-trot", "horse-walk"]
    actor = Actor(ActorConfig(robot="go2", labels=labels, hidden=[32, 16]))
    with torch.no_grad():
        for parameter in actor.parameters():
            parameter.copy_(0.1 * torch.randn(parameter.shape, generator=generator))
        actor.mean.copy_(torch.randn(OBSERVATION_SIZE, generator=generator))
        actor.variance.copy_(torch.rand(OBSERVATION_SIZE, generator=generator))
        actor.variance[3] = 0.0  # of what never changed in training
    weights, out = folder / "policy.safetensors", folder / "policy.onnx"
    save_actor(actor, weights)
    figures = folder / "metadata.json"
    line = ["export", "--policy", str(weights), "--onnx", str(out)]
    assert main([*line, "--json", str(figures)]) == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        "metadata.json",
        "policy.onnx",
        "policy.safetensors",
    ]
    session = onnxruntime.InferenceSession(out)
    return load_actor(weights, get_robot("go2")), session, figures


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("scale", [0.0, 1.0, 1e3, 1e30, np.inf])
def test_onnx_does_what_the_actor_does(exported, count, scale):
    """Whatever is observed, also far beyond what the normalizer clips."""
    actor, session, _ = exported
    random = np.random.default_rng(1)
    observations = random.standard_normal((count, OBSERVATION_SIZE))
    observations = np.where(scale, scale * observations, 0.0).astype(np.float32)
    (actions,) = session.run(["action"], {"observation": observations})
    with torch.inference_mode():
        expected = actor(torch.from_numpy(observations)).numpy()
    assert actions.shape == (count, 12)
    assert np.isfinite(expected).all()
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)


def test_the_file_says_all_that_running_it_takes(exported):
    _, session, figures = exported
    metadata = session.get_modelmeta().custom_metadata_map
    assert json.loads(figures.read_text()) == metadata
    assert metadata["kind"] == "loco_drake policy"
    assert metadata["robot"] == "go2"
    assert json.loads(metadata["labels"]) == ["dog-trot", "horse-walk"]
    assert json.loads(metadata["observation_layout"]) == [
        list(part) for part in OBSERVATION_LAYOUT
    ]
    assert json.loads(metadata["rate"]) == 50
    assert json.loads(metadata["action_scale"]) == 0.15
    joints = json.loads(metadata["joint_names"])
    robot = get_robot("go2")
    assert joints == list(robot.joint_names)
    assert json.loads(metadata["standing_joints"]) == robot.stand_joints.tolist()
    # The gains of the Go2's motors: 100 Nm/rad and 3 Nm s/rad at every joint.
    assert json.loads(metadata["kp"]) == [100.0] * 12
    assert json.loads(metadata["kd"]) == [3.0] * 12
    assert json.loads(metadata["velocity_gain"]) == [2.0] * 12
    formula = "(velocity_gain v + tau) / kp + action_scale * action"
    assert formula in metadata["set_points"]
    assert "dog: CC BY-NC 4.0" in metadata["licence"]
    assert "horse: CC BY-SA 4.0" in metadata["licence"]
    assert "solo8" not in metadata["licence"]


def test_five_test_vectors_are_what_the_file_computes(exported):
    _, session, _ = exported
    about = json.loads(session.get_modelmeta().custom_metadata_map["deployment"])
    assert about["schema_version"] == 2
    cases = about["test_vectors"]
    seen = np.array([case["observation"] for case in cases])
    assert seen.shape == (5, OBSERVATION_SIZE)
    (actions,) = session.run(["action"], {"observation": seen.astype(np.float32)})
    expected = np.array([case["action"] for case in cases])
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(actions, expected, atol=about["test_tolerance"])


def test_it_says_what_a_policy_ignores(exported):
    actor, session, _ = exported
    assert session.get_modelmeta().custom_metadata_map["ignored_parts"] == "[]"
    config = replace(actor.config, privileged=False)
    metadata = policy_metadata(Actor(config), get_robot("go2"))
    ignored = json.loads(metadata["ignored_parts"])
    assert ignored == ["v_WB_H", "height", "plan_p_H"]


def test_without_the_extra_one_sentence_says_what_to_install(
    exported, tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, "onnxscript", None)
    out = tmp_path / "policy.onnx"
    assert main(["export", "--onnx", str(out)]) == 2
    assert capsys.readouterr().err == (
        "loco-drake: To export to ONNX, install the packages onnx and onnxscript, the "
        "extra 'onnx' of loco_drake.\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_policy_with_a_history_is_given_back_its_memory(tmp_path):
    """An episode of three robots, step by step, as by the network in the diagram."""
    config = ActorConfig(robot="go2", labels=[], hidden=[16], privileged=False)
    actor = make_actor(replace(config, labels=["dog-trot"], history=5)).eval()
    path = tmp_path / "policy.onnx"
    metadata = export_onnx(actor, get_robot("go2"), path)
    assert json.loads(metadata["ignored_parts"]) == ["v_WB_H"]
    session = onnxruntime.InferenceSession(path)
    random = torch.Generator().manual_seed(0)
    run = torch.randn(8, 3, OBSERVATION_SIZE, generator=random)
    memory, expected = np.zeros((3, actor.memory_size), dtype=np.float32), None
    for observation in run:
        with torch.inference_mode():
            expected = actor.step(
                observation,
                torch.zeros(3, actor.memory_size) if expected is None else expected[1],
            )
        inputs = {"observation": observation.numpy(), "memory": memory}
        action, memory = session.run(["action", "next_memory"], inputs)
        np.testing.assert_allclose(action, expected[0], rtol=0, atol=1e-5)
        np.testing.assert_allclose(memory, expected[1], rtol=0, atol=1e-5)
