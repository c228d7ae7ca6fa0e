from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy.spatial.transform import Rotation

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import yaw_of
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.reward import REWARD_TERMS
from loco_drake.control.state import TerminationConfig
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion_file import save_motion
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import ExternalAction, PlanReference, Scenario
from loco_drake.systems.simulator import MakeSimulator, StartEpisode
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.environment import TrackingEnv, make_tracking
from loco_drake.tracking.references import load_references
from tests.synthetic_motion import synthetic_motion

ANYWHERE = TerminationConfig(position=1e3, rotation=1e3)  # but fallen
NO_NOISE = ResetNoise(joints=0, velocities=0, position=0, heading=0)
STILL = np.zeros(12, dtype=np.float32)


@pytest.fixture
def env(plans):
    return TrackingEnv(plans, EnvironmentConfig(reset_noise=NO_NOISE))


# Recommendations, not requirements: actions are normal variates, clipped only far out,
# and observations are physical quantities without bounds.
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized space")
@pytest.mark.filterwarnings("ignore:.*Box observation space m.* value is -?infinity")
def test_gymnasiums_checker_finds_nothing(plans):
    check_env(TrackingEnv(plans), skip_render_check=True)


def test_gymnasium_makes_it_by_name(tmp_path):
    save_motion(synthetic_motion("dog-trot", 2.0), tmp_path / "trot.npz")
    env = gymnasium.make("loco_drake/Tracking-v0", references=tmp_path)
    assert isinstance(env.unwrapped, TrackingEnv)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)


def test_without_references_it_generates_some():
    env = make_tracking(labels=["dog-trot"], count=2, seconds=3.0)
    assert len(env.plans) == 2
    assert all(abs(plan.end_time - 3.0) < 0.1 for plan in env.plans)


def test_an_episode_starts_in_the_plans_state_and_earns_all_there_is(env):
    _, info = env.reset(options={"plan": 1, "sample": 40})
    assert info == {"plan": 1, "sample": 40}
    _, reward, _, _, info = env.step(STILL)
    assert 0.8 < reward <= 1.0
    assert reward == pytest.approx(sum(info[name] for name in _terms()))


def _terms():
    return ("joints", "joint_velocities", "toes", "base_pose", "base_velocity")


@pytest.mark.parametrize(
    ("contact", "time_step", "tolerance"),
    [("similar", 0.01, 0.0), ("lagged", 0.001, 0.0), ("cenic", 0.01, 2e-2)],
)
def test_a_step_is_what_the_diagram_does(plans, contact, time_step, tolerance):
    """The whole diagram, in a simulator of its own, goes the same way.

    Another robot of the batch does something else in between. Discrete plants agree to
    the last bit. An integrator begins each control period with a step of its own
    choice, which here it forgets between two robots.
    """
    plant = PlantConfig(contact=contact, time_step=time_step, accuracy=1e-4)
    random = np.random.default_rng(0)
    actions = 0.3 * random.standard_normal((6, 12)).astype(np.float32)
    config = EnvironmentConfig(plant=plant, reset_noise=NO_NOISE)
    batch = TrackingBatch(plans, config, 2)
    batch.reset(0, random, 0, 25)
    batch.reset(1, random, 1, 3)

    scenario = Scenario(
        plant=plant,
        reference=PlanReference(),
        smoother=None,
        policy=ExternalAction(),
    )
    diagram = MakeLocomotionDiagram(scenario)
    simulator = MakeSimulator(diagram, scenario)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("action").FixValue(context, np.zeros(12))
    StartEpisode(simulator, plan=replace(plans[0].slice(25), start_time=0.0))
    ports = [diagram.GetOutputPort(name) for name in ("observation", "reward_terms")]
    for k, action in enumerate(actions):
        terms = batch.step(np.stack((action, -action)))[0]
        diagram.GetInputPort("action").FixValue(context, action.astype(float))
        simulator.AdvanceTo((1 + k) * PLAN_DT)
        observation, theirs = (port.Eval(context) for port in ports)
        ours = batch.observe()[0]
        np.testing.assert_allclose(
            ours, observation.astype(np.float32), rtol=0, atol=tolerance
        )
        np.testing.assert_allclose(terms[0], theirs, rtol=0, atol=tolerance)


def test_the_position_penalty_takes_its_share_for_each_metre_beside_the_plan(plans):
    """Of the reward, not of its terms, from which returns are made."""
    free, called = (
        TrackingEnv(plans, EnvironmentConfig(position_penalty=homing))
        for homing in (0.0, 0.3)
    )
    for env in (free, called):
        env.reset(seed=0, options={"plan": 0, "sample": 10})
    for k in range(1, 6):
        (_, reward, *_, info), (_, less, *_, same) = (
            free.step(STILL),
            called.step(STILL),
        )
        assert info == same
        x, y = called._batch._state[0, 4:6] - plans[0].state[10 + k, 4:6]
        assert reward - less == pytest.approx(0.3 * (x * x + y * y) ** 0.5)
        assert less < reward


def test_the_action_penalty_takes_its_share_of_the_mean_square(plans):
    """Of twelve actions, two are 2 and the others 0: the mean square is 8 / 12."""
    env = TrackingEnv(plans, EnvironmentConfig(action_penalty=0.3))
    env.reset(seed=0, options={"plan": 0, "sample": 10})
    action = np.zeros(12, dtype=np.float32)
    action[[1, 7]] = 2.0
    _, reward, *_, info = env.step(action)
    terms = sum(info[name] for name in REWARD_TERMS)
    assert terms - reward == pytest.approx(0.3 * 8 / 12)


def test_a_fall_costs_what_it_is_to_cost(plans):
    env = TrackingEnv(plans, EnvironmentConfig(fall_cost=4.0, termination=ANYWHERE))
    env.reset(seed=0, options={"plan": 0, "sample": 10})
    terms, reward, terminated = 0.0, 0.0, False
    thrown = np.full(12, 8.0, dtype=np.float32)
    for _ in range(100):
        assert reward == pytest.approx(terms)
        _, reward, terminated, _, info = env.step(thrown)
        terms = sum(info[name] for name in REWARD_TERMS)
        if terminated:
            break
    assert terminated
    assert reward == pytest.approx(terms - 4.0)


def test_time_limits_truncate(plans):
    env = TrackingEnv(plans, EnvironmentConfig(episode_steps=5))
    env.reset(seed=0, options={"plan": 0, "sample": 10})
    ends = [env.step(STILL)[2:4] for _ in range(5)]
    assert ends == [(False, False)] * 4 + [(False, True)]


def test_the_end_of_the_plan_truncates(env, plans):
    env.reset(seed=0, options={"plan": 0, "sample": len(plans[0]) - 3})
    assert env.step(STILL)[2:4] == (False, False)
    assert env.step(STILL)[2:4] == (False, True)


def test_falls_terminate(env):
    """With its legs pulled up the robot drops on its trunk."""
    env.reset(seed=0, options={"plan": 0, "sample": 0})
    folded = np.tile([0.0, 10.0, -10.0], 4).astype(np.float32)
    for _ in range(100):
        _, _, terminated, truncated, _ = env.step(folded)
        if terminated or truncated:
            break
    assert terminated
    assert not truncated


def test_losing_the_plan_terminates(plans):
    config = EnvironmentConfig()
    config.termination.position = 1e-3
    env = TrackingEnv(plans, config)
    env.reset(seed=0, options={"plan": 0, "sample": 0})
    assert any(env.step(STILL)[2] for _ in range(20))


def test_same_seed_same_episode_other_seed_another(plans):
    def episode(seed):
        env = TrackingEnv(plans)
        first, info = env.reset(seed=seed)
        return info, first, [env.step(STILL)[0] for _ in range(5)]

    one, two, other = episode(1), episode(1), episode(2)
    assert one[0] == two[0]
    np.testing.assert_array_equal(one[1], two[1])
    np.testing.assert_array_equal(one[2], two[2])
    assert (one[1] != other[1]).any()


def test_robots_of_a_batch_share_a_diagram_but_no_state(plans):
    """Two side by side do what each does alone, to the last bit."""
    config = EnvironmentConfig(reset_noise=NO_NOISE)
    starts, actions = [(0, 0), (1, 30)], np.array([0.5, -0.5]) * np.ones((12, 2))

    def run(robots):
        batch = TrackingBatch(plans, config, len(robots))
        for i, robot in enumerate(robots):
            batch.reset(i, np.random.default_rng(0), *starts[robot])
        terms = [batch.step(actions.T[robots])[0] for _ in range(10)]
        return batch.observe(), np.array(terms)

    both = run([0, 1])
    for robot in range(2):
        alone = run([robot])
        np.testing.assert_array_equal(alone[0][0], both[0][robot])
        np.testing.assert_array_equal(alone[1][:, 0], both[1][:, robot])


def test_reset_noise_moves_and_turns_the_robot_as_a_whole(plans):
    """Turned by psi about z, velocities with it; joints and heights as they were."""
    noise = ResetNoise(joints=0, velocities=0, position=0.5, heading=0.5)
    state = plans[0].state[20].copy()
    near = noise.draw(state, np.random.default_rng(0))
    psi = yaw_of(near[:4]) - yaw_of(state[:4])
    assert abs(psi) > 0.01
    turn = Rotation.from_euler("z", psi)
    np.testing.assert_allclose(near[22:25], turn.apply(state[22:25]), atol=1e-9)
    np.testing.assert_allclose(near[19:22], turn.apply(state[19:22]), atol=1e-9)
    own = turn * Rotation.from_quat(state[:4], scalar_first=True)
    there = Rotation.from_quat(near[:4], scalar_first=True)
    np.testing.assert_allclose(there.as_matrix(), own.as_matrix(), atol=1e-9)
    assert np.linalg.norm(near[4:6] - state[4:6]) > 0.05
    np.testing.assert_array_equal(near[6:19], state[6:19])
    np.testing.assert_array_equal(near[25:], state[25:])


def test_references_must_be_there_and_of_the_robot(tmp_path):
    with pytest.raises(InputError, match="no Motion files"):
        load_references(get_robot("go2"), tmp_path)
    save_motion(synthetic_motion("dog-trot", 2.0), tmp_path / "trot.npz")
    with pytest.raises(InputError, match="of go2, not of a1"):
        load_references(get_robot("a1"), tmp_path)


def test_all_environments_of_a_process_simulate_one_diagram(plans):
    """Drake never frees a diagram that has systems in Python."""
    first, second = (TrackingEnv(plans) for _ in range(2))
    assert first._batch._worlds[0]._diagram is second._batch._worlds[0]._diagram
