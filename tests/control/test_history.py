"""What a policy without privileged observations remembers, and what follows from it."""

from dataclasses import asdict

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.control.actor import ActorConfig, mirror_actions, mirror_observations
from loco_drake.control.actor_file import act, load_actor, save_actor
from loco_drake.control.history import (
    FRAME,
    FRAME_SIZE,
    MAX_OFFSET,
    completed,
    make_memory,
    recall,
    remember,
)
from loco_drake.control.history_actor import HistoryActor
from loco_drake.control.observation import OBSERVATION_SIZE, PLACES, observe, preview
from loco_drake.control.plan import plan_from_motion
from loco_drake.control.state import POSITION, VELOCITY, split
from loco_drake.models.robots import get_robot
from tests.synthetic_motion import synthetic_motion

HISTORY = 3


@pytest.fixture(scope="module")
def actor():
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        actor = HistoryActor(
            ActorConfig(
                robot="go2",
                labels=["dog-trot"],
                hidden=[32, 16],
                privileged=False,
                history=HISTORY,
            )
        )
        actor.mean.normal_(std=0.1)
        actor.variance.uniform_(0.5, 2.0)
        # As a training's are.
        actor.mean.copy_((actor.mean + mirror_observations(actor.mean)) / 2)
        image = mirror_observations(actor.variance).abs()
        actor.variance.copy_((actor.variance + image) / 2)
    return actor.eval()


@pytest.fixture(scope="module")
def situation():
    """Robot, plan, and a state beside it."""
    robot = get_robot("go2")
    plan = plan_from_motion(robot, synthetic_motion("dog-trot", 2.0, 0.5, 0.3))
    state = plan.state[40] + 0.05 * np.random.default_rng(0).standard_normal(37)
    state[:4] /= np.linalg.norm(state[:4])
    return robot, plan, state


def seen(situation, state):
    robot, plan, _ = situation
    observation = observe(robot, preview(plan, 0.8), state, np.full(12, 0.5))
    return torch.from_numpy(observation)


def test_neither_action_nor_memory_depends_on_position_and_velocity(actor, situation):
    """A robot 3 m away at another height, and of another speed, measures the same."""
    _, _, state = situation
    elsewhere = state.copy()
    q, v = split(elsewhere)
    q[POSITION] += [3.0, -2.0, 0.4]
    v[VELOCITY] += [1.0, 2.0, -0.5]
    memory = torch.randn(actor.memory_size, generator=torch.Generator().manual_seed(0))
    memory[0] = 1.0
    here, there = (
        actor.step(seen(situation, x).float(), memory) for x in (state, elsewhere)
    )
    for a, b in zip(here, there, strict=True):
        torch.testing.assert_close(a, b, atol=1e-5, rtol=1e-5)


def test_an_observation_completed_with_the_truth_is_the_true_one(situation):
    """By the offset of the plan's present sample, the velocity and the height."""
    _, plan, state = situation
    observation = seen(situation, state)
    (q, _), R_WH = split(state), heading(state)
    offset = (plan.q[40, 4:7] - q[POSITION]) @ R_WH
    truth = observation[PLACES["v_WB_H"]], observation[PLACES["height"]]
    again = completed(observation, *truth, torch.from_numpy(offset[:2]))
    # The plan's velocity is a difference of its positions, to a tenth of a millimetre.
    torch.testing.assert_close(again, observation, atol=2e-4, rtol=0)
    moved = completed(
        observation, *truth, torch.from_numpy(offset[:2] + np.array([0.3, -0.2]))
    )
    gap = (moved - again)[PLACES["plan_p_H"]].reshape(4, 3)
    np.testing.assert_allclose(gap, [[0.3, -0.2, 0.0]] * 4, atol=1e-9)
    higher = completed(
        observation, truth[0], truth[1] + 0.1, torch.from_numpy(offset[:2])
    )
    gap = (higher - again)[PLACES["plan_p_H"]].reshape(4, 3)
    np.testing.assert_allclose(gap, [[0.0, 0.0, -0.1]] * 4, atol=1e-9)


def heading(state):
    w, x, y, z = state[:4]
    forward = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z)])
    c, s = forward / np.linalg.norm(forward)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_the_odometry_adds_up_how_far_the_plan_runs_ahead():
    """1 m/s planned, .5 made, half a second: 25 cm behind, 45 degrees turned."""
    observation = torch.zeros(OBSERVATION_SIZE, dtype=torch.float64)
    observation[PLACES["gravity_B"]] = torch.tensor([0.0, 0.0, -1.0]).double()
    observation[PLACES["plan_v_H"].start] = 1.0
    memory = make_memory(torch.zeros(2), torch.zeros(HISTORY, FRAME_SIZE)).double()
    velocity = torch.tensor([0.5, 0.0, 0.0]).double()
    for _ in range(25):
        memory = remember(observation, memory, velocity)
    offset, _ = recall(observation, memory)
    np.testing.assert_allclose(offset, [0.25, 0.0], atol=1e-12)
    # On the spot it turns left: what was ahead is then to the right.
    observation[PLACES["plan_v_H"].start] = 0.5
    observation[PLACES["w_WB_B"].start + 2] = np.pi / 2
    for _ in range(25):
        memory = remember(observation, memory, velocity)
    offset, _ = recall(observation, memory)
    np.testing.assert_allclose(offset, 0.25 * np.array([1, -1]) / 2**0.5, atol=1e-12)
    for _ in range(1000):
        memory = remember(observation, memory, -velocity)
    assert recall(observation, memory)[0].abs().max() <= MAX_OFFSET


def test_a_memory_holds_the_last_measurements_newest_first():
    """The first measurement stands for those before it."""
    random = torch.Generator().manual_seed(0)
    run = torch.randn(6, OBSERVATION_SIZE, generator=random)
    memory = torch.zeros(3 + HISTORY * FRAME_SIZE)
    for n, observation in enumerate(run):
        _, frames = recall(observation, memory)
        expected = [run[max(0, n - back), FRAME] for back in (1, 2, 3)]
        torch.testing.assert_close(frames, torch.stack(expected), rtol=0, atol=0)
        memory = remember(observation, memory, torch.zeros(3))


def test_a_mirrored_run_is_acted_in_mirrored(actor):
    """Bit for bit, whatever has been remembered."""
    random = torch.Generator().manual_seed(0)
    run = torch.randn(5, 4, OBSERVATION_SIZE, generator=random)
    memory = torch.zeros(4, actor.memory_size)
    image = memory.clone()
    with torch.inference_mode():
        for observation in run:
            action, memory = actor.step(observation, memory)
            mirrored, image = actor.step(mirror_observations(observation), image)
            assert torch.equal(mirrored, mirror_actions(action))
    assert action.abs().max() > 1e-2


def test_what_was_measured_before_makes_a_difference(actor):
    first, other, now = torch.randn(3, OBSERVATION_SIZE)
    memories = [
        actor.step(x, torch.zeros(actor.memory_size))[1] for x in (first, other)
    ]
    a, b = (actor.step(now, memory)[0] for memory in memories)
    assert (a - b).abs().max() > 1e-4


def test_a_history_is_saved_with_its_policy(actor, tmp_path):
    path = tmp_path / "policy.safetensors"
    save_actor(actor, path)
    again = load_actor(path, get_robot("go2"))
    assert isinstance(again, HistoryActor)
    assert asdict(again.config) == asdict(actor.config)
    random = np.random.default_rng(0)
    observation = random.standard_normal(OBSERVATION_SIZE)
    memory = np.zeros(actor.memory_size)
    for a, b in zip(
        act(actor, observation, memory), act(again, observation, memory), strict=True
    ):
        np.testing.assert_array_equal(a, b)
    # Without a memory there is nothing before: the first action of an episode.
    torch.testing.assert_close(
        again(torch.from_numpy(observation).float()).double(),
        torch.from_numpy(act(again, observation, memory)[0]),
    )


@pytest.mark.parametrize("changes", [{"privileged": True}, {"history": 4097}])
def test_a_header_that_makes_no_sense_is_refused(actor, tmp_path, changes):
    path = tmp_path / "policy.safetensors"
    config = actor.config
    actor.config = ActorConfig(**{**asdict(config), **changes})
    save_actor(actor, path)
    actor.config = config
    with pytest.raises(InputError, match="damaged header"):
        load_actor(path, get_robot("go2"))
