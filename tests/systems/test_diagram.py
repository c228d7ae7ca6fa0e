from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from pydrake.systems.analysis import Simulator

from loco_drake.common.errors import InputError
from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import load_actor, save_actor
from loco_drake.control.plan import first_change
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import policy_path, policy_variants, pretrained_dir
from loco_drake.motion.motion_file import save_motion
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import (
    ExternalAction,
    ExternalTargets,
    GeneratedReference,
    MotionReference,
    PlanReference,
    Scenario,
    SteeringConfig,
    TrainedPolicy,
)
from loco_drake.systems.simulator import StartEpisode
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """A policy that knows nothing, for what does not depend on how well it does."""
    path = tmp_path_factory.mktemp("weights") / "policy.safetensors"
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        save_actor(Actor(ActorConfig(robot="go2", labels=["dog-trot"])), path)
    return path


@pytest.fixture(scope="module")
def generated(weights):
    """The whole diagram: generator, smoother, policy, plant."""
    return MakeLocomotionDiagram(
        Scenario(
            reference=GeneratedReference(gait="dog-pace", seed=1),
            policy=TrainedPolicy(weights=weights),
        )
    )


def states(diagram, times):
    simulator = Simulator(diagram)
    StartEpisode(simulator)
    port = diagram.GetOutputPort("state")
    result = []
    for time in times:
        simulator.AdvanceTo(time)
        result.append(port.Eval(simulator.get_context()).copy())
    return np.array(result)


def test_ports_and_systems_have_names(generated):
    inputs = [generated.get_input_port(i).get_name() for i in range(1)]
    assert inputs == ["gait"]
    for name in ("plan", "plan_state", "path_time", "state", "observation", "action"):
        assert generated.HasOutputPort(name)
    assert generated.HasOutputPort("reward_terms")
    assert generated.HasOutputPort("net_actuation")
    for name in ("plant", "scene_graph", "reference", "smoother", "joint_targets"):
        assert generated.GetSubsystemByName(name).get_name() == name


def test_the_robot_starts_where_its_plan_starts(generated):
    simulator = Simulator(generated)
    StartEpisode(simulator)
    context = simulator.get_context()
    plan = generated.GetOutputPort("plan").Eval(context)
    state = generated.GetOutputPort("state").Eval(context)
    np.testing.assert_allclose(state, plan.state[0], atol=1e-12)
    assert generated.GetOutputPort("reward_terms").Eval(context).sum() == (
        pytest.approx(1.0)
    )


def test_the_same_context_gives_the_same_states(generated):
    times = [0.5, 1.3]
    np.testing.assert_array_equal(states(generated, times), states(generated, times))


def test_a_cloned_context_goes_the_same_way(generated):
    simulator = Simulator(generated)
    StartEpisode(simulator)
    simulator.AdvanceTo(0.33)
    clone = Simulator(generated, simulator.get_context().Clone())
    simulator.AdvanceTo(1.5)
    port = generated.GetOutputPort("state")
    first = port.Eval(simulator.get_context()).copy()
    clone.AdvanceTo(1.5)
    np.testing.assert_array_equal(port.Eval(clone.get_context()), first)
    np.testing.assert_array_equal(port.Eval(simulator.get_context()), first)


def test_a_generator_is_told_the_command_if_the_scenario_wants_it(weights, generated):
    """Without a command the states are those of any other diagram, to the last bit."""
    scenario = Scenario(
        reference=GeneratedReference(gait="dog-pace", seed=1),
        steering=SteeringConfig(tell=True, bend=False),
        policy=TrainedPolicy(weights=weights),
    )
    diagram = MakeLocomotionDiagram(scenario)
    np.testing.assert_array_equal(states(diagram, [1.0]), states(generated, [1.0]))
    simulator = Simulator(diagram)
    StartEpisode(simulator)
    context = simulator.get_mutable_context()
    before = diagram.GetOutputPort("plan").Eval(context)
    diagram.GetInputPort("command").FixValue(context, [0.6, 0.0, 0.7])
    reference = diagram.GetSubsystemByName("reference")
    raw = reference.GetOutputPort("plan")
    own = reference.GetMyContextFromRoot(context)
    told_before = raw.Eval(own)
    simulator.AdvanceTo(0.5)
    plan = diagram.GetOutputPort("plan").Eval(context)
    assert 0.16 < first_change(told_before, raw.Eval(own)) < 0.5
    assert first_change(before, plan) < 0.6
    np.testing.assert_array_equal(diagram.GetOutputPort("followed").Eval(context), 0)


def test_a_played_motion_is_not_told(tmp_path, weights):
    save_motion(synthetic_motion("dog-trot", 2.0, 0.5), tmp_path / "trot.npz")
    scenario = Scenario(
        reference=MotionReference(path=tmp_path / "trot.npz"),
        steering=SteeringConfig(tell=True),
        policy=TrainedPolicy(weights=weights),
    )
    reference = MakeLocomotionDiagram(scenario).GetSubsystemByName("reference")
    assert not reference.HasInputPort("command")


def test_the_plan_can_come_from_a_motion_file(tmp_path, weights):
    motion = synthetic_motion("dog-trot", 2.0, 0.5)
    save_motion(motion, tmp_path / "trot.npz")
    diagram = MakeLocomotionDiagram(
        Scenario(
            reference=MotionReference(path=tmp_path / "trot.npz"),
            policy=TrainedPolicy(weights=weights),
        )
    )
    simulator = Simulator(diagram)
    StartEpisode(simulator)
    simulator.AdvanceTo(0.4)
    wanted = diagram.GetOutputPort("plan_state").Eval(simulator.get_context())
    np.testing.assert_allclose(wanted[7:19], motion.joint_positions[20], atol=1e-9)


def test_an_open_action_port_drives_the_joints():
    diagram = MakeLocomotionDiagram(
        Scenario(reference=PlanReference(), smoother=None, policy=ExternalAction())
    )
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    action = np.zeros(12)
    action[2::3] = 0.4
    port = diagram.GetInputPort("action").FixValue(context, np.zeros(12))
    StartEpisode(simulator)
    simulator.AdvanceTo(1.0)
    before = diagram.GetOutputPort("state").Eval(context)[9:19:3].copy()
    port.GetMutableData().get_mutable_value().set_value(action)
    simulator.AdvanceTo(2.0)
    after = diagram.GetOutputPort("state").Eval(context)[9:19:3]
    # .1 rad more on each calf, less what the weight takes of it.
    assert (after - before > 0.05).all()
    assert (after - before < 0.2).all()


def test_open_targets_leave_the_plant_alone():
    """It stands on its stance, and bends its knees by what they are sent."""
    diagram = MakeLocomotionDiagram(Scenario(policy=ExternalTargets()))
    names = {system.get_name() for system in diagram.GetSystems()}
    assert names == {"plant", "scene_graph", "robot_state"}
    robot = get_robot("go2")
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    knees = []
    for bend in (0.0, 0.1):
        q_d = robot.stand_joints + bend * np.tile([0.0, 0.0, 1.0], 4)
        targets = np.concatenate((q_d, np.zeros(12)))
        diagram.GetInputPort("desired_state").FixValue(context, targets)
        simulator.AdvanceTo(context.get_time() + 1.0)
        knees.append(diagram.GetOutputPort("state").Eval(context)[9:19:3])
    np.testing.assert_allclose(knees[0], robot.stand_joints[2::3], atol=0.1)
    np.testing.assert_allclose(knees[1] - knees[0], 0.1, atol=0.03)


def test_a_robot_without_weights_says_which_have_some():
    robot = replace(get_robot("a1"), name="spot")
    with pytest.raises(InputError, match=r"weights for spot.*for go2, a1"):
        policy_path(robot)


def test_a_policy_is_a_file_or_the_name_of_a_shipped_one(tmp_path, monkeypatch):
    robot = get_robot("a1")
    assert policy_path(robot) == pretrained_dir() / "policy_a1.safetensors"
    there = tmp_path / "mine.safetensors"
    assert policy_path(robot, there) == there
    variants = policy_variants(robot)
    assert "unprivileged" in variants
    for name, path in variants.items():
        assert policy_path(robot, Path(name)) == path
        sees = load_actor(path, robot).config.privileged
        assert sees == (name != "unprivileged")
    with pytest.raises(InputError, match=r"'robust'.*there are unprivileged"):
        policy_path(robot, Path("robust"))
    # A file of that name, without a suffix, comes first.
    monkeypatch.chdir(tmp_path)
    Path("unprivileged").touch()
    assert policy_path(robot, Path("unprivileged")) == Path("unprivileged")
