"""Two networks: one near the plan, one far from it."""

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.control.actor import (
    Actor,
    ActorConfig,
    mirror_actions,
    mirror_observations,
)
from loco_drake.control.actor_file import load_actor, read_actor, save_actor
from loco_drake.control.observation import OBSERVATION_SIZE, PLACES, observe, preview
from loco_drake.control.plan import PLAN_DT, plan_from_motion
from loco_drake.control.recovery import RECOVERY, share_of_recovery
from loco_drake.models.robots import get_robot
from loco_drake.tracking.joining import join_policies, joined, near_of, recovery_of
from tests.synthetic_motion import synthetic_motion


def actor(seed, **config):
    """Returns a network with weights and symmetric statistics of its own."""
    torch.manual_seed(seed)
    made = Actor(ActorConfig(robot="go2", labels=["dog-trot"], hidden=[32], **config))
    mean, variance = torch.randn(OBSERVATION_SIZE), torch.rand(OBSERVATION_SIZE)
    made.mean.copy_(0.05 * (mean + mirror_observations(mean)))
    made.variance.copy_(0.5 + variance + mirror_observations(variance).abs())
    return made.eval()


def at(v=(0.0, 0.0), p=(0.0, 0.0), R=(0.0, 0.0, 0.0)):
    """Returns an observation whose base is off its next sample by this."""
    seen = torch.zeros(OBSERVATION_SIZE)
    for name, off in (("plan_v_H", v), ("plan_p_H", p), ("plan_R_B", R)):
        start = PLACES[name].start
        seen[start : start + len(off)] = torch.tensor(off)
    return seen


@pytest.mark.parametrize(
    ("off", "share"),
    [
        ({}, 0.0),
        ({"v": (0.25, 0.0)}, 0.0),
        ({"v": (0.3, 0.4)}, 1.0),
        ({"v": (0.0, 0.25 * np.sqrt(1.5))}, 0.5),
        ({"p": (0.08, 0.04)}, 0.25),
        ({"R": (0.2, 0.1, 0.1)}, 0.5),
        ({"v": (0.25, 0.0), "p": (0.0, 0.08)}, 1.0),
        ({"v": (0.15, 0.0), "p": (0.0, 0.04), "R": (0.1, 0.0, 0.0)}, 0.0),
    ],
)
def test_the_share_grows_with_what_the_base_is_off(off, share):
    found = share_of_recovery(at(**off), [0.25, 0.08, 0.2])
    assert found.shape == (1,)
    assert found.item() == pytest.approx(share, abs=1e-5)


def test_a_robot_on_its_plan_is_off_by_nothing_and_one_beside_it_is(go2):
    """At any velocity: what counts is where it will be at the next sample."""
    plan = plan_from_motion(go2, synthetic_motion(seconds=0.5, speed=1.4))
    time = plan.start_time + 5 * PLAN_DT
    state = np.concatenate((plan.q[5], plan.v[5]))
    shares = []
    for aside in (0.0, 0.5):
        state[5] += aside
        seen = observe(go2, preview(plan, time), state, np.zeros(12))
        shares.append(share_of_recovery(torch.tensor(seen), RECOVERY).item())
    assert shares == [0.0, 1.0]


def test_one_network_acts_near_the_plan_and_the_other_far_from_it():
    near, far = actor(0), actor(1)
    both = joined(near, far)
    with torch.inference_mode():
        for off in ({}, {"v": (1.0, 0.0)}, {"p": (0.12, 0.06)}):
            seen = at(**off)
            share = share_of_recovery(seen, RECOVERY).item()
            expected = (1 - share) * near(seen) + share * far(seen)
            torch.testing.assert_close(both(seen), expected, rtol=1e-4, atol=1e-5)
    assert (near(at()) - far(at())).abs().max() > 0.05


def test_actions_of_both_are_symmetric():
    torch.manual_seed(2)
    both = joined(actor(0), actor(1))
    seen = 0.1 * torch.randn(64, OBSERVATION_SIZE)
    share = share_of_recovery(seen, RECOVERY)
    assert 0.1 < ((share > 0) & (share < 1)).float().mean() < 0.9
    assert torch.equal(share, share_of_recovery(mirror_observations(seen), RECOVERY))
    with torch.inference_mode():
        image = mirror_actions(both(mirror_observations(seen)))
        torch.testing.assert_close(both(seen), image, rtol=0, atol=1e-6)


def test_files_are_joined_and_parted_again(tmp_path):
    near, far = tmp_path / "near", tmp_path / "far"
    learner = {"count": torch.tensor(3.0)}
    save_actor(actor(0), near, learner=learner)
    save_actor(actor(1), far)
    join_policies(near, far, tmp_path / "both")
    both, kept = read_actor(tmp_path / "both")
    assert both.config.recovery == RECOVERY
    assert kept == learner
    seen = torch.randn(8, OBSERVATION_SIZE)
    loaded = load_actor(tmp_path / "both", get_robot("go2"))
    with torch.inference_mode():
        assert torch.equal(loaded(seen), joined(actor(0), actor(1))(seen))
        assert torch.equal(near_of(loaded)(seen), actor(0)(seen))
        alone = recovery_of(loaded)(0.1 * seen)
        torch.testing.assert_close(alone, actor(1)(0.1 * seen), rtol=1e-4, atol=1e-5)
    assert recovery_of(actor(0)) is None


@pytest.mark.parametrize(
    "other", [{"privileged": False}, {"recovery": RECOVERY}, {"feed_forward": "weight"}]
)
def test_what_does_not_fit_is_not_joined(other, tmp_path):
    save_actor(actor(0), tmp_path / "near")
    save_actor(actor(1, **other), tmp_path / "far")
    with pytest.raises(InputError, match="do not fit each other"):
        join_policies(tmp_path / "near", tmp_path / "far", tmp_path / "both")
    assert not (tmp_path / "both").exists()


@pytest.mark.parametrize("recovery", [[], [0.25, 0.08], [0.25, 0.0, 0.2]])
def test_thresholds_that_make_no_sense_are_damage(recovery, tmp_path):
    both = joined(actor(0), actor(1))
    both.config.recovery = recovery
    save_actor(both, tmp_path / "both")
    with pytest.raises(InputError, match="no network can be built"):
        load_actor(tmp_path / "both", get_robot("go2"))
