from dataclasses import fields, replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.control.observation import OBSERVATION_LAYOUT
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import TerminationConfig
from loco_drake.models.robots import get_robot
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.domain import SetDomain
from loco_drake.systems.scenario import (
    Disturbances,
    ExternalAction,
    PlanReference,
    Scenario,
)
from loco_drake.systems.simulator import MakeSimulator, PlaceOnPlan
from loco_drake.tracking.batch import TrackingBatch
from loco_drake.tracking.config import EnvironmentConfig, ResetNoise
from loco_drake.tracking.environment import TrackingEnv
from loco_drake.tracking.randomization import (
    BIAS,
    PUSH_DURATION,
    STANDARD,
    WHITE,
    RandomizationConfig,
)

NO_NOISE = ResetNoise(joints=0, velocities=0, position=0, heading=0)
# What the standard set leaves as in the model.
OTHERS = {
    "damping": (1.2, 1.2),
    "joint_friction": (0.2, 0.2),
    "slope": (5.0, 5.0),
    "roughness": (0.02, 0.02),
}
PARTS = [
    part.name
    for part in fields(STANDARD)
    if part.name not in ("push_interval", "nominal_share", *OTHERS)
]


@pytest.fixture
def go2():
    return get_robot("go2")


def test_off_by_default_and_then_nothing_is_drawn(go2):
    config = RandomizationConfig()
    assert config.is_off
    assert config.disturbances == Disturbances()
    random = np.random.default_rng(0)
    domain = config.draw(go2, random, 0.0, 10.0)
    assert domain.friction is domain.payload is domain.sensors is None
    assert domain.pushes == ()
    assert random.random() == np.random.default_rng(0).random()


def test_draws_fill_their_ranges_evenly(go2):
    """Means of 2,000 uniform draws, and their extremes."""
    random = np.random.default_rng(0)
    domains = [STANDARD.draw(go2, random, 0.0, 10.0) for _ in range(2000)]
    for values, (low, high) in (
        ([d.friction for d in domains], STANDARD.friction),
        (np.log([d.stiffness for d in domains]), np.log(STANDARD.stiffness)),
        ([d.payload for d in domains], STANDARD.payload),
        ([d.com_shift[1] for d in domains], STANDARD.com_shift),
        ([d.strength[5] for d in domains], STANDARD.motor_strength),
        ([d.latency for d in domains], STANDARD.latency),
    ):
        span = high - low
        assert low <= min(values) < low + 0.01 * span
        assert high - 0.01 * span < max(values) <= high
        assert np.mean(values) == pytest.approx((low + high) / 2, abs=0.03 * span)
    biases = np.array([d.sensors.bias for d in domains])
    np.testing.assert_allclose(biases.std(axis=0), BIAS, rtol=0.1)
    assert (domains[0].sensors.white == WHITE).all()


def test_pushes_are_impulses_of_the_stated_size_at_the_stated_times(go2):
    """.5 m/s of 16.085 kg in .1 s: 80.4 N, every 2 s of an episode from 1 to 9.5 s."""
    config = RandomizationConfig(push=(0.5, 0.5), push_interval=(2.0, 2.0))
    pushes = config.draw(go2, np.random.default_rng(0), 1.0, 9.5).pushes
    assert [push.start for push in pushes] == pytest.approx([3.0, 5.0, 7.0, 9.0])
    forces = np.array([push.force_W for push in pushes])
    np.testing.assert_allclose(np.linalg.norm(forces, axis=1), 80.425)
    assert (forces[:, 2] == 0).all()
    assert len(np.unique(forces[:, 0])) == 4
    assert {push.duration for push in pushes} == {PUSH_DURATION}


def test_the_standard_set_fills_what_is_not_given():
    config = RandomizationConfig(payload=(0.0, 0.0), noise=2.0).with_standard()
    assert config.payload == (0.0, 0.0)
    assert config.noise == 2.0
    assert config.friction == STANDARD.friction
    assert all(getattr(config, name) is not None for name in PARTS)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("friction", (1.0, 0.5), "friction must be two numbers"),
        ("friction", (0.0, 0.5), "at least 0.001"),
        ("payload", (-9.0, 0.0), "at least -3"),
        ("motor_strength", (0.9, 2.0), "at most 1.5"),
        ("latency", (0.0, 1.0), "at most 0.1"),
        ("damping", (0.1, 1.0), "at least 0.5"),
        ("joint_friction", (0.0, 2.0), "at most 0.5"),
        ("slope", (-5.0, 5.0), "slope must be .* at least 0 and at most 30"),
        ("roughness", (0.0, 1.0), "at most 0.1"),
        ("push", (0.0, np.inf), "push must be"),
        ("push_interval", (0.0, 1.0), "push_interval must be"),
        ("noise", -1.0, "noise must be 0 or more"),
        ("noise", float("nan"), "noise must be 0 or more"),
    ],
)
def test_bad_ranges_are_one_sentence(name, value, message):
    with pytest.raises(InputError, match=message) as error:
        RandomizationConfig(**{name: value}).check()
    assert "\n" not in str(error.value)


def test_weak_and_undamped_motors_are_refused_together(go2):
    """.85 times .9 is below the .79 that the Go2's mass matrix allows."""
    config = RandomizationConfig(motor_strength=(0.85, 1.0), damping=(0.9, 1.2))
    with pytest.raises(InputError, match=r"at least 0\.79 .* not 0\.765"):
        config.check(go2)
    replace(config, damping=(0.95, 1.2)).check(go2)


def test_parts_beyond_the_standard_set_leave_its_worlds_as_they_are(go2):
    """They draw last, so the same seed gives the same friction, pushes and noise."""
    more = replace(STANDARD, **OTHERS)
    worlds = [
        config.draw(go2, np.random.default_rng(5), 0.0, 10.0)
        for config in (STANDARD, more)
    ]
    assert worlds[0].friction == worlds[1].friction
    assert worlds[0].sensors.seed == worlds[1].sensors.seed
    assert worlds[0].terrain is worlds[0].damping is None
    assert worlds[0].joint_friction == 0.0
    assert worlds[1].damping == 1.2
    rise = np.linalg.norm(worlds[1].terrain.gradient)
    assert rise == pytest.approx(np.tan(np.deg2rad(5.0)))


def test_same_seed_same_episode_other_seed_another(plans):
    def episode(seed):
        env = TrackingEnv(plans, EnvironmentConfig(randomization=STANDARD))
        first, _ = env.reset(seed=seed)
        action = np.zeros(12, dtype=np.float32)
        return np.array([first, *(env.step(action)[0] for _ in range(8))])

    one, two, other = episode(1), episode(1), episode(2)
    np.testing.assert_array_equal(one, two)
    assert (one != other).any()


def test_a_nominal_world_is_the_models_after_a_random_one_in_the_same_context(plans):
    """Its ground has a damping of its own, which matters by some 1e-4."""
    everything = replace(STANDARD, push=None, **OTHERS)

    def end(batch):
        batch.reset(0, np.random.default_rng(3), 0, 10)
        for _ in range(20):
            batch.step(np.full((1, 12), 0.3))
        return batch.observe()[0]

    def batch(randomization):
        config = EnvironmentConfig(reset_noise=NO_NOISE, randomization=randomization)
        return TrackingBatch(plans, config, 1)

    expected = end(batch(RandomizationConfig()))
    drawn = batch(everything)
    assert np.abs(end(drawn) - expected).max() > 0.05
    drawn._config.randomization.nominal_share = 1.0
    np.testing.assert_allclose(end(drawn), expected, atol=2e-3)


def test_a_share_of_the_worlds_is_nominal_but_for_pushes(go2):
    config = replace(STANDARD, nominal_share=0.3)
    random = np.random.default_rng(0)
    domains = [config.draw(go2, random, 0.0, 10.0) for _ in range(2000)]
    nominal = [d for d in domains if d.payload == 0]
    assert len(nominal) == pytest.approx(600, abs=60)
    assert all(d.pushes for d in nominal)
    for domain in nominal:
        assert domain.friction == 0.8
        assert domain.latency == 0
        assert (domain.strength == 1).all()
        assert not domain.com_shift.any()
        assert not domain.sensors.white.any()
        assert not domain.sensors.bias.any()


@pytest.mark.parametrize("name", [*PARTS, *OTHERS])
def test_each_part_alone_changes_what_happens(plans, name):
    """From the same start with the same actions; noise alone shows at once."""

    def observe(randomization):
        config = EnvironmentConfig(reset_noise=NO_NOISE, randomization=randomization)
        batch = TrackingBatch(plans, config, 1)
        batch.reset(0, np.random.default_rng(3), 0, 10)
        start = batch.observe()[0]
        for _ in range(20):
            batch.step(np.full((1, 12), 0.3))
        return start, batch.observe()[0]

    drawn = (0.02, 0.02) if name == "latency" else getattr(STANDARD, name)
    drawn = OTHERS.get(name, drawn)
    part = RandomizationConfig(push_interval=(0.2, 0.2), **{name: drawn})
    start, end = observe(RandomizationConfig())
    other_start, other_end = observe(part)
    assert np.abs(end - other_end).max() > 1e-3
    assert (start != other_start).any() == (name in ("noise", "slope", "roughness"))


def test_a_batch_does_what_the_diagram_does(plans, go2):
    """The same world, plan and actions in a diagram with a simulator of its own."""
    randomization = replace(STANDARD, push_interval=(0.3, 0.4), **OTHERS)
    config = EnvironmentConfig(reset_noise=NO_NOISE, randomization=randomization)
    batch = TrackingBatch(plans, config, 2)
    batch.reset(1, np.random.default_rng(1), 1, 0)
    batch.reset(0, np.random.default_rng(7), 0, 25)
    actions = 0.3 * np.random.default_rng(0).standard_normal((40, 2, 12))
    ours = []
    for action in actions:
        batch.step(action)
        ours.append(batch.observe()[0])

    scenario = Scenario(
        reference=PlanReference(),
        smoother=None,
        policy=ExternalAction(),
        disturbances=randomization.disturbances,
    )
    diagram = MakeLocomotionDiagram(scenario)
    simulator = MakeSimulator(diagram, scenario)
    context = simulator.get_mutable_context()
    end = min(25 + config.episode_steps, len(plans[0]) - 1)
    random = np.random.default_rng(7)
    random.standard_normal(33)  # the reset noise: 1 + 2 + 12 + 18
    domain = randomization.draw(go2, random, 25 * PLAN_DT, end * PLAN_DT)
    SetDomain(diagram, context, domain)
    context.SetTime(25 * PLAN_DT)
    player = diagram.GetSubsystemByName("reference")
    player.SetPlan(player.GetMyMutableContextFromRoot(context), plans[0])
    PlaceOnPlan(diagram, context)
    for k, action in enumerate(actions[:, 0]):
        diagram.GetInputPort("action").FixValue(context, action)
        simulator.AdvanceTo((26 + k) * PLAN_DT)
        theirs = diagram.GetOutputPort("observation").Eval(context)
        np.testing.assert_allclose(ours[k], theirs, rtol=1e-5, atol=1e-5)
    assert domain.pushes[0].start < (25 + 40) * PLAN_DT


def test_rewards_are_of_the_true_state_observations_of_the_measured_one(plans):
    noisy = EnvironmentConfig(
        reset_noise=NO_NOISE, randomization=RandomizationConfig(noise=1.0)
    )
    plain = EnvironmentConfig(reset_noise=NO_NOISE)
    results = []
    for config in (noisy, plain):
        batch = TrackingBatch(plans, config, 1)
        batch.reset(0, np.random.default_rng(0), 0, 0)
        terms = [batch.step(np.zeros((1, 12)))[0] for _ in range(10)]
        results.append((np.array(terms), batch.observe()[0]))
    np.testing.assert_array_equal(results[0][0], results[1][0])
    changed = results[0][1] != results[1][1]
    start = 0
    for name, size in OBSERVATION_LAYOUT:
        of_the_plan = name in ("last_action", "plan_contacts", "label")
        if of_the_plan or name == "plan_joint_velocities":
            assert not changed[start : start + size].any()
        else:
            assert changed[start : start + size].any()
        start += size


def test_without_position_only_position_is_forgiven():
    config = EnvironmentConfig(randomization=STANDARD).known_to(privileged=False)
    assert config.termination.position == 1.0
    assert config.termination.rotation == EnvironmentConfig().termination.rotation
    assert config.reset_noise.position == 0.0
    assert config.reset_noise.heading == ResetNoise().heading
    assert config.randomization == STANDARD


def test_without_position_a_wider_tube_stays():
    tube = TerminationConfig(position=1.5)
    config = EnvironmentConfig(termination=tube).known_to(privileged=False)
    assert config.termination.position == 1.5
