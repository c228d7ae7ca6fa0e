"""A mirrored world looks and is acted in like the mirror image of the world."""

import numpy as np
import pytest

from loco_drake.models.robots import get_robot
from loco_drake.motion import (
    MIRROR_AXIAL,
    MIRROR_JOINT_SIGNS,
    MIRROR_JOINTS,
    MIRROR_POLAR,
    MIRROR_QUATERNION,
)
from loco_drake.systems.observation import OBSERVATION_SIZE, observe, preview
from loco_drake.systems.plan import plan_from_motion
from loco_drake.tracking.environment import ACTION_SPACE, OBSERVATION_SPACE
from loco_drake.tracking.symmetry import (
    SymmetricRolloutBuffer,
    SymmetricStatistics,
    mirror_actions,
    mirror_observations,
)
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


def test_minibatches_hold_each_step_and_its_image():
    buffer = SymmetricRolloutBuffer(4, OBSERVATION_SPACE, ACTION_SPACE, n_envs=2)
    random = np.random.default_rng(2)
    buffer.observations[:] = random.standard_normal((4, 2, OBSERVATION_SIZE))
    buffer.actions[:] = random.standard_normal((4, 2, 12))
    buffer.advantages[:] = np.arange(8).reshape(4, 2)
    buffer.full = True
    batches = list(buffer.get(4))
    assert [len(batch.actions) for batch in batches] == [8, 8]
    for batch in batches:
        steps, images = batch.actions[:4].numpy(), batch.actions[4:].numpy()
        np.testing.assert_allclose(mirror_actions(steps), images)
        seen, mirrored = batch.observations.numpy().reshape(2, 4, -1)
        np.testing.assert_allclose(mirror_observations(seen), mirrored)
        first, second = batch.advantages.numpy().reshape(2, 4)
        np.testing.assert_array_equal(first, second)
    assert sorted(float(a) for b in batches for a in b.advantages[:4]) == [*range(8)]


def test_normalized_observations_mirror_like_any():
    """Left joints at 1, right ones at 0: the statistics are those of both sides."""
    statistics = SymmetricStatistics(shape=(OBSERVATION_SIZE,))
    random = np.random.default_rng(3)
    for _ in range(3):
        statistics.update(1.0 + random.standard_normal((50, OBSERVATION_SIZE)))
    np.testing.assert_allclose(
        mirror_observations(statistics.mean), statistics.mean, atol=1e-6
    )
    assert statistics.mean[1] == pytest.approx(0.0, abs=1e-12)  # y of gravity
    assert statistics.count == pytest.approx(300, abs=1)
