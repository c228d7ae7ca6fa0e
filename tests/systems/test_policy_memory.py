"""A policy with a history in the diagram: its memory is in the Context."""

import numpy as np
import pytest
import torch

from loco_drake.control.actor import ActorConfig
from loco_drake.control.actor_file import act, load_actor, save_actor
from loco_drake.control.history_actor import HistoryActor
from loco_drake.control.plan import PLAN_DT
from loco_drake.models.robots import get_robot
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import PlanReference, Scenario, TrainedPolicy
from loco_drake.systems.simulator import MakeSimulator, StartEpisode


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The diagram with a policy that knows nothing, its scenario and its network."""
    path = tmp_path_factory.mktemp("weights") / "policy.safetensors"
    config = ActorConfig(robot="go2", labels=["dog-trot"], privileged=False, history=4)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        save_actor(HistoryActor(config), path)
    scenario = Scenario(
        reference=PlanReference(), smoother=None, policy=TrainedPolicy(weights=path)
    )
    actor = load_actor(path, get_robot("go2"))
    return MakeLocomotionDiagram(scenario), scenario, actor


def test_each_action_is_of_what_was_observed_until_then(made, trot):
    """The actions in use are those of a loop beside the diagram, bit for bit."""
    diagram, scenario, actor = made
    simulator = MakeSimulator(diagram, scenario)
    context = simulator.get_mutable_context()
    StartEpisode(simulator, plan=trot)
    memory, forgetful = np.zeros(actor.memory_size), []
    for k in range(20):
        observation = diagram.GetOutputPort("observation").Eval(context)
        action, memory = act(actor, observation, memory)
        first, _ = act(actor, observation, np.zeros(actor.memory_size))
        forgetful.append(np.abs(action - first).max())
        simulator.AdvanceTo((k + 1) * PLAN_DT)
        np.testing.assert_array_equal(
            diagram.GetOutputPort("action").Eval(context), action
        )
    policy = diagram.GetSubsystemByName("policy")
    own = policy.GetMyContextFromRoot(context)
    np.testing.assert_array_equal(own.get_discrete_state(0).value(), memory)
    assert forgetful[0] == 0
    assert max(forgetful) > 1e-4


def test_clones_go_on_identically_and_an_episode_begins_with_nothing(made, trot):
    diagram, scenario, _ = made
    port = diagram.GetOutputPort("state")
    simulator = MakeSimulator(diagram, scenario)
    ends = []
    for _ in range(2):
        StartEpisode(simulator, plan=trot)
        simulator.AdvanceTo(0.31)
        clone = MakeSimulator(diagram, scenario)
        clone.reset_context(simulator.get_context().Clone())
        for each in (simulator, clone):
            each.AdvanceTo(0.8)
            ends.append(port.Eval(each.get_context()).copy())
    for end in ends[1:]:
        np.testing.assert_array_equal(end, ends[0])


def test_policies_without_a_history_have_no_state(trot):
    diagram = MakeLocomotionDiagram(
        Scenario(reference=PlanReference(), policy=TrainedPolicy())
    )
    policy = diagram.GetSubsystemByName("policy")
    context = policy.CreateDefaultContext()
    assert context.is_stateless()
