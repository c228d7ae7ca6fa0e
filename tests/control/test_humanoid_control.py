"""What is computed of a humanoid: observation, reward, torques and action."""

from dataclasses import asdict, replace

import numpy as np
import pytest
import torch
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from loco_drake.common.errors import InputError
from loco_drake.common.gravity import GRAVITY
from loco_drake.control.actor import Actor, ActorConfig, config_for, mirrors
from loco_drake.control.actor_file import load_actor, make_actor, save_actor
from loco_drake.control.feed_forward import feed_forward_torques
from loco_drake.control.observation import LAYOUT, layout_of, observe, preview
from loco_drake.control.plan import standing_plan
from loco_drake.control.recovery import RECOVERY
from loco_drake.control.reward import reward_terms
from loco_drake.models.robots import get_simulated
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from tests.humanoid_motion import (
    march_plan,
    mirror_joints,
    mirror_state,
    mirrored_plan,
)

ON_PLAN = ResetNoise(joints=0, velocities=0, position=0, heading=0)


@pytest.fixture(scope="module")
def g1():
    return get_simulated("g1")


@pytest.fixture(scope="module")
def layout(g1):
    return layout_of(g1)


@pytest.fixture
def actor(g1):
    torch.manual_seed(0)
    return Actor(config_for(g1, labels=[], hidden=[16], recovery=RECOVERY)).eval()


def test_sizes_are_the_robots(g1, layout):
    assert layout_of(get_simulated("go2")) is layout_of(get_simulated("a1")) is LAYOUT
    # Eight numbers for each joint, and the same for all else.
    assert layout.size - LAYOUT.size == 8 * (29 - 12)
    seen = observe(g1, preview(march_plan(), 0.2), march_plan().state[10], np.zeros(29))
    assert seen.shape == (layout.size,)
    assert [name for name, _ in layout.parts] == [name for name, _ in LAYOUT.parts]
    off = march_plan().q[11] - march_plan().q[10]
    np.testing.assert_allclose(seen[layout.places["plan_joints"]][:29], off[7:])


def test_a_mirrored_world_is_observed_mirrored(g1, layout):
    random = np.random.default_rng(0)
    state = march_plan().state[30] + 0.1 * random.standard_normal(71)
    state[:4] /= np.linalg.norm(state[:4])
    action = random.standard_normal(29)
    mirror, mirror_actions = mirrors(layout)
    seen = observe(g1, preview(march_plan(), 0.6), state, action)
    image = observe(
        g1, preview(mirrored_plan(), 0.6), mirror_state(state), mirror_actions(action)
    )
    np.testing.assert_allclose(mirror(seen), image, atol=1e-5)
    np.testing.assert_array_equal(mirror(mirror(seen)), seen)
    assert np.abs(mirror(seen) - seen).max() > 0.1


def test_a_mirrored_simulation_is_the_mirror_image(layout):
    """The same actions, mirrored, on the mirrored plan: physics, and the policy's."""
    config = EnvironmentConfig(robot="g1", reset_noise=ON_PLAN)
    batch = TrackingBatch([march_plan(), mirrored_plan()], config, 2)
    random = np.random.default_rng(1)
    for i in range(2):
        batch.reset(i, random, plan=i, sample=8)
    mirror, mirror_actions = mirrors(layout)
    for _ in range(6):
        action = 0.3 * random.standard_normal(29)
        terms, lost, _ = batch.step(np.stack((action, mirror_actions(action))))
        assert not lost.any()
        state, image = batch.states
        np.testing.assert_allclose(mirror_state(state), image, atol=2e-3)
        np.testing.assert_allclose(terms[0], terms[1], atol=1e-3)
        seen = batch.observe()
        np.testing.assert_allclose(mirror(seen[0]), seen[1], atol=2e-3)
    assert np.abs(state - image).max() > 0.1


def test_the_policy_of_a_mirrored_world_acts_mirrored(layout, actor):
    mirror, mirror_actions = mirrors(layout)
    seen = torch.randn(6, layout.size)
    with torch.inference_mode():
        actions = actor(seen)
        assert actions.shape == (6, 29)
        torch.testing.assert_close(mirror_actions(actions), actor(mirror(seen)))
    np.testing.assert_allclose(
        mirror_actions(actions.numpy()), mirror_joints(actions.numpy()), rtol=1e-6
    )


def test_an_error_of_every_joint_costs_as_much_as_of_a_quadruped(g1):
    """The joints' terms are of the mean error: here .1 rad and 1 rad/s."""
    for robot in (g1, get_simulated("go2")):
        plan, joints = standing_plan(robot), len(robot.joint_names)
        state = plan.state[0].copy()
        terms = reward_terms(robot, plan.state[0], plan.p_BoF_H[0], state)
        assert terms.sum() == pytest.approx(1.0)
        state[7 : 7 + joints] += 0.1
        state[-joints:] += 1.0
        terms = reward_terms(robot, plan.state[0], plan.p_BoF_H[0], state)
        expected = [0.5 * np.exp(-5 * 12 * 0.01), 0.05 * np.exp(-0.1 * 12)]
        np.testing.assert_allclose(terms[:2], expected)


def test_torques_of_the_stance_carry_the_robot(g1):
    """Virtual work: as legs bend over soles that stay, all that is heavy sinks."""
    torques = feed_forward_torques(g1, standing_plan(g1))[0]
    plant = MultibodyPlant(time_step=0.0)
    g1.AddModel(Parser(plant))
    plant.Finalize()
    context = plant.CreateDefaultContext()

    def height(joints):
        """Of the centre of mass over the soles."""
        plant.SetPositions(context, [1.0, *[0.0] * 6, *joints])
        return (
            plant.CalcCenterOfMassPositionInWorld(context)[2]
            - g1.contact_points(joints)[:, 2].mean()
        )

    bend, step = np.zeros(29), 1e-5
    for leg in (0, 6):
        # Pitch of hip, knee and ankle, with the sole level.
        bend[[leg, leg + 3, leg + 4]] = [-0.5, 1.0, -0.5]
    ends = [height(g1.stand_joints + sign * step * bend) for sign in (-1, 1)]
    rise = (ends[1] - ends[0]) / (2 * step)
    assert rise < -0.01
    assert torques @ bend == pytest.approx(g1.mass * GRAVITY * rise, rel=0.03)
    assert (np.abs(torques) < 0.5 * g1.effort_limits).all()
    np.testing.assert_allclose(mirror_joints(torques), torques, atol=0.2)


def test_a_policys_file_says_how_its_joints_are_mirrored(g1, actor, tmp_path):
    path = tmp_path / "policy.safetensors"
    save_actor(actor, path)
    loaded = load_actor(path, g1)
    seen = torch.randn(3, actor.layout.size)
    assert loaded.config == actor.config
    assert torch.equal(loaded(seen), actor(seen))
    with pytest.raises(InputError, match="for another robot: g1, not go2"):
        load_actor(path, get_simulated("go2"))
    turned = [-sign for sign in actor.config.mirror_signs]
    other = make_actor(replace(actor.config, mirror_signs=turned))
    save_actor(other, path)
    with pytest.raises(InputError, match="is for another mirror signs"):
        load_actor(path, g1)


def test_a_file_that_mirrors_no_joints_is_refused(g1, actor, tmp_path):
    path = tmp_path / "policy.safetensors"
    actor.config.mirror_joints[0] = 2
    save_actor(actor, path)
    with pytest.raises(InputError, match="is for another mirror joints"):
        load_actor(path, g1)


def test_policies_of_before_have_the_mirroring_of_three_joints_a_leg():
    before = asdict(ActorConfig(robot="go2", labels=[]))
    assert before == asdict(config_for(get_simulated("go2"), labels=[]))
    assert before["mirror_joints"] == [4, 5, 6, 1, 2, 3, 10, 11, 12, 7, 8, 9]
    assert before["mirror_signs"] == [-1.0, 1.0, 1.0] * 4
