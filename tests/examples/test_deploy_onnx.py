"""What examples/deploy_onnx.py computes for itself is what the package computes."""

import ast
import importlib.util
from pathlib import Path

import numpy as np
import onnx
import pytest
from pydrake.common.value import Value

from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import act, make_actor
from loco_drake.control.observation import OBSERVATION_SIZE
from loco_drake.control.plan import PLAN_DT, make_plan
from loco_drake.control.plan_file import save_plan
from loco_drake.control.state import has_fallen
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.systems.control import Observation
from loco_drake.tracking.deployment import deployment
from loco_drake.tracking.onnx_policy import export_onnx

pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

SCRIPT = Path(__file__).parents[2] / "examples" / "deploy_onnx.py"


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("deploy_onnx", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def random_rotations(random, count):
    quaternions = random.standard_normal((count, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def random_plan(robot, random, count=40):
    """Samples that have nothing to do with each other."""
    position, joints = random.normal(size=(count, 3)), random.normal(size=(count, 12))
    q = np.hstack((random_rotations(random, count), position, joints))
    contacts = random.random((count, 4)) < 0.5
    labels = random.integers(len(LABELS), size=count)
    v = random.normal(size=(count, 18))
    return make_plan(robot, q=q, v=v, contacts=contacts, labels=labels)


@pytest.mark.parametrize("name", ROBOTS)
def test_it_observes_what_the_port_outputs(example, tmp_path, name):
    """Of random states and plans, also where the plan ends."""
    robot, random = get_robot(name), np.random.default_rng(0)
    about = deployment(Actor(ActorConfig(robot=name, labels=["dog-trot"])), robot)
    plan = random_plan(robot, random)
    save_plan(robot, plan, plan.end_time, tmp_path / "plans.npz")
    with np.load(tmp_path / "plans.npz", allow_pickle=False) as archive:
        arrays = dict(archive)
    system = Observation(robot)
    context = system.CreateDefaultContext()
    system.GetInputPort("plan").FixValue(context, Value(plan))
    for n in (0, 1, 17, 30, 35, 39):
        q = np.concatenate((random_rotations(random, 1)[0], random.normal(size=15)))
        v, action = random.normal(size=18), random.normal(size=12)
        context.SetTime(n * PLAN_DT)
        system.GetInputPort("state").FixValue(context, np.concatenate((q, v)))
        system.GetInputPort("action").FixValue(context, action)
        expected = system.GetOutputPort("observation").Eval(context)
        ahead = example.look_ahead(about, arrays, n)
        found = example.observe(about, ahead, q, v, action)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_it_tells_falls_as_the_package_does(example, go2):
    about = deployment(Actor(ActorConfig(robot="go2", labels=["dog-trot"])), go2)
    random = np.random.default_rng(1)
    q = np.zeros((300, 19))
    tilts = random_rotations(random, 300)
    tilts[:, 0] += 1.0  # towards upright
    q[:, :4] = tilts / np.linalg.norm(tilts, axis=1, keepdims=True)
    q[:, 6] = random.uniform(0.0, 0.3, 300)
    expected = has_fallen(go2, q)
    assert 50 < expected.sum() < 250
    assert [example.has_fallen(about, row) for row in q] == expected.tolist()


def test_it_keeps_the_memory_of_a_policy_with_a_history(example, go2, tmp_path):
    """Its test vectors hold, and an episode begins with nothing."""
    labels = ["dog-trot"]
    config = ActorConfig(robot="go2", labels=labels, privileged=False, history=3)
    actor = make_actor(config)
    export_onnx(actor, go2, tmp_path / "policy.onnx")
    policy = example.Policy(tmp_path / "policy.onnx")
    assert policy.check() < 1e-5
    policy.begin()
    memory = np.zeros(actor.memory_size)
    for observation in np.random.default_rng(0).normal(size=(5, OBSERVATION_SIZE)):
        expected, memory = act(actor, observation, memory)
        np.testing.assert_allclose(policy.act(observation), expected, atol=1e-5)


def test_a_file_that_is_missing_is_named(example, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["deploy_onnx.py", "--policy", "none.onnx"])
    with pytest.raises(SystemExit) as exit_info:
        example.main()
    assert exit_info.value.code == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.endswith("There is no file none.onnx; loco-drake export writes it.")


def test_a_network_without_the_metadata_is_refused(example, tmp_path):
    path = tmp_path / "plain.onnx"
    value = onnx.helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1])
    node = onnx.helper.make_node("Identity", ["x"], ["y"])
    result = onnx.helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [1])
    graph = onnx.helper.make_graph([node], "plain", [value], [result])
    opsets = [onnx.helper.make_opsetid("", 17)]
    onnx.save(onnx.helper.make_model(graph, opset_imports=opsets, ir_version=8), path)
    with pytest.raises(SystemExit, match="says not how to run it"):
        example.Policy(path)


def test_it_imports_what_any_user_of_mujoco_has():
    names = set()
    for node in ast.walk(ast.parse(SCRIPT.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module.split(".")[0])
    standard = {"argparse", "json", "pathlib", "typing"}
    assert names - standard == {"mujoco", "numpy", "onnxruntime"}
