"""A mirrored world looks and is acted in like the mirror image of the world."""

import numpy as np
import pytest
import torch

from loco_drake.control.actor import (
    Actor,
    ActorConfig,
    mirror_actions,
    mirror_observations,
)
from loco_drake.control.observation import OBSERVATION_SIZE, observe, preview
from loco_drake.control.plan import plan_from_motion
from loco_drake.models.legs import (
    MIRROR_AXIAL,
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_POLAR,
    MIRROR_QUATERNION,
)
from loco_drake.models.robots import get_robot
from tests.synthetic_motion import synthetic_motion


@pytest.mark.parametrize("name", ["go2", "a1"])
def test_a_mirrored_world_is_observed_mirrored(name):
    """Robot, plan and action mirrored by the rules for Motion files."""
    robot, random = get_robot(name), np.random.default_rng(0)
    motion = synthetic_motion("dog-pace", 2.0, 0.4, name=name)
    plan = plan_from_motion(robot, motion)
    image = plan_from_motion(robot, motion.mirrored())
    state = plan.state[40] + 0.1 * random.standard_normal(37)
    state[:4] /= np.linalg.norm(state[:4])
    action = random.standard_normal(12)
    mirrored = np.concatenate(
        (
            state[:4] * MIRROR_QUATERNION,
            state[4:7] * MIRROR_POLAR,
            state[7:19][MIRROR_JOINTS] * MIRROR_JOINT_SIGNS,
            state[19:22] * MIRROR_AXIAL,
            state[22:25] * MIRROR_POLAR,
            state[25:][MIRROR_JOINTS] * MIRROR_JOINT_SIGNS,
        )
    )
    seen = observe(robot, preview(plan, 0.8), state, action)
    seen_mirrored = observe(
        robot, preview(image, 0.8), mirrored, mirror_actions(action)
    )
    np.testing.assert_allclose(mirror_observations(seen), seen_mirrored, atol=1e-6)
    assert np.abs(mirror_observations(seen) - seen).max() > 0.1


def test_mirroring_twice_changes_nothing():
    random = np.random.default_rng(1)
    observations = random.standard_normal((5, OBSERVATION_SIZE))
    actions = random.standard_normal((5, 12))
    np.testing.assert_array_equal(
        mirror_observations(mirror_observations(observations)), observations
    )
    np.testing.assert_array_equal(mirror_actions(mirror_actions(actions)), actions)


def test_arrays_and_tensors_mirror_alike():
    random = np.random.default_rng(2)
    observations = random.standard_normal((5, OBSERVATION_SIZE)).astype(np.float32)
    actions = random.standard_normal((5, 12)).astype(np.float32)
    for mirror, values in (
        (mirror_observations, observations),
        (mirror_actions, actions),
    ):
        np.testing.assert_array_equal(
            mirror(torch.from_numpy(values)).numpy(), mirror(values)
        )


def test_the_policy_of_a_mirrored_world_acts_mirrored():
    torch.manual_seed(0)
    actor = Actor(ActorConfig(robot="go2", labels=[], hidden=[32, 16]))
    observations = torch.randn(6, OBSERVATION_SIZE)
    with torch.inference_mode():
        actions = actor(observations)
        mirrored = actor(mirror_observations(observations))
    torch.testing.assert_close(mirror_actions(actions), mirrored)
    assert (mirrored - actions).abs().max() > 0.01
