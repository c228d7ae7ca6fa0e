"""The G1 in the diagram that robots on four legs are simulated with."""

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.models.robots import get_simulated
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import (
    Disturbances,
    ExternalAction,
    LoadScenario,
    PlanReference,
    Scenario,
)
from loco_drake.systems.simulator import MakeSimulator, StartEpisode
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.environment import TrackingEnv
from tests.humanoid_motion import march_plan


def test_it_moves_as_in_training_to_the_last_bit():
    scenario = Scenario(robot="g1", reference=PlanReference(), policy=ExternalAction())
    diagram = MakeLocomotionDiagram(scenario)
    for name in ("steering", "smoother"):
        assert not diagram.HasSubsystemNamed(name)
    simulator = MakeSimulator(diagram, scenario)
    action = np.random.default_rng(0).standard_normal((20, 29)).astype(np.float32)
    port = diagram.GetInputPort("action")
    value = port.FixValue(simulator.get_mutable_context(), 0 * action[0])
    StartEpisode(simulator, plan=march_plan())
    still = ResetNoise(joints=0, velocities=0, position=0, heading=0)
    config = EnvironmentConfig(robot="g1", reset_noise=still)
    env = TrackingEnv([march_plan()], config)
    seen, _ = env.reset(options={"plan": 0, "sample": 0})
    assert env.action_space.shape == (29,)
    assert env.observation_space.contains(seen)
    for k, act in enumerate(0.2 * action):
        value.GetMutableData().get_mutable_value().set_value(act.astype(float))
        simulator.AdvanceTo(0.02 * (k + 1))
        seen, reward, terminated, _, _ = env.step(act)
        assert not terminated
        context = simulator.get_context()
        state = diagram.GetOutputPort("state").Eval(context)
        np.testing.assert_array_equal(state, env._batch.states[0])
        observed = diagram.GetOutputPort("observation").Eval(context)
        np.testing.assert_array_equal(observed.astype(np.float32), seen)
        terms = diagram.GetOutputPort("reward_terms").Eval(context)
        assert terms.sum() == pytest.approx(reward)


def test_with_the_torques_of_the_plan_alone_it_walks_for_a_while():
    """Half a second of the march, with no policy: it moves on as the plan does."""
    still = ResetNoise(joints=0, velocities=0, position=0, heading=0)
    config = EnvironmentConfig(robot="g1", reset_noise=still)
    env = TrackingEnv([march_plan()], config)
    env.reset(options={"plan": 0, "sample": 10})
    rewards = [env.step(np.zeros(29, np.float32))[1] for _ in range(25)]
    assert np.mean(rewards) > 0.8


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("robot: g1", "g1 follows a Motion file"),
        ("robot: g2", "the choices are go2, a1, g1, or"),
        (
            "{robot: g1, reference: !PlanReference {}, disturbances: {pushes: true}}",
            "Disturbances are of robots with three joints a leg, not of g1",
        ),
        (
            "{robot: g1, reference: !PlanReference {}, plant: {time_step: 0.02}}",
            "must be at most 0.0146",
        ),
    ],
)
def test_what_it_cannot_do_is_refused(text, reason):
    with pytest.raises(InputError, match=reason):
        MakeLocomotionDiagram(LoadScenario(data=text))


def test_a_world_of_the_plant_alone_needs_no_reference():
    assert Scenario(robot="g1").disturbances == Disturbances()
    assert get_simulated("g1").weights is None
