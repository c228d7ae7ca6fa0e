"""Control periods in worlds that were drawn, and laws there."""

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.control.actor_file import load_actor
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.guidance import find_law
from loco_drake.tracking.guided_config import GuidedConfig, IlqrConfig, StretchConfig
from loco_drake.tracking.problem import TrackingProblem
from loco_drake.tracking.randomization import RandomizationConfig


def environment(latency):
    """A heavy robot with unlike motors on slippery ground."""
    worlds = RandomizationConfig(
        friction=(0.4, 0.5),
        stiffness=(5e4, 6e4),
        payload=(1.5, 2.0),
        com_shift=(-0.02, 0.02),
        motor_strength=(0.85, 1.1),
        damping=(1.1, 1.2),
        latency=(latency, latency),
    )
    return EnvironmentConfig(robot="go2", randomization=worlds)


@pytest.mark.parametrize("latency", [0.0, 0.01, 0.02])
def test_a_period_is_that_of_an_episode(trot, latency):
    config = environment(latency)
    random = np.random.default_rng(0)
    batch = TrackingBatch([trot], config, 1)
    batch.reset(0, random, 0, 5)
    problem = TrackingProblem(trot, config, batch.drawn(0))
    before = np.zeros(12)
    like_the_model = TrackingProblem(trot, config)
    for k in range(6):
        action = 0.3 * random.standard_normal(12)
        state = batch.states[0]
        batch.step(action[None])
        # At first an episode has no set-points before.
        last = action if k == 0 else before
        after = problem.next_state(6 + k, state, action, last)
        if k > 0 or latency == 0:
            assert after == pytest.approx(batch.states[0], abs=1e-9)
        other = like_the_model.next_state(6 + k, state, action, last)
        assert np.abs(other - after).max() > 1e-3
        before = action


@pytest.mark.parametrize("latency", [0.0, 0.01, 0.02])
def test_delayed_actions_count_in_the_next_period(trot, latency):
    batch = TrackingBatch([trot], environment(latency), 1)
    batch.reset(0, np.random.default_rng(1), 0, 5)
    problem = TrackingProblem(trot, environment(latency), batch.drawn(0))
    A, B = problem.linearize(6, trot.state[5], np.zeros(12), np.zeros(12))
    assert A.shape == (36, 48)
    assert B.shape == (36, 12)
    assert np.abs(A[:, 36:]).max() > 0.5 or latency == 0
    assert np.abs(B).max() > 0.5 or latency == 0.02
    # Of a delay of a period nothing is felt in it.
    assert latency < 0.02 or np.abs(B).max() < 1e-12
    assert latency > 0 or not A[:, 36:].any()


def test_a_law_in_a_world_that_was_drawn(plans):
    actor = load_actor(pretrained_path("policy_go2"), get_robot("go2"))
    ilqr = IlqrConfig(iterations=1, steps=1)
    short = StretchConfig(length=34, tail=4, lead=3, push=(0.5, 1.0), ilqr=ilqr)
    found = find_law(plans, actor, environment(0.02), short, (0, 0, 1))
    assert found.law.reward > found.before
    assert len(found.law) == 30


def test_worlds_in_which_no_laws_are_found():
    for name, value in (("push", (0.0, 1.0)), ("noise", 1.0), ("slope", (0.0, 5.0))):
        worlds = RandomizationConfig(**{name: value})
        with pytest.raises(InputError, match=f"leave out --randomization.{name}"):
            GuidedConfig(randomization=worlds).check()
    slow = RandomizationConfig(latency=(0.0, 0.03))
    with pytest.raises(InputError, match=r"latency of at most 0\.02 s"):
        GuidedConfig(randomization=slow).check()
