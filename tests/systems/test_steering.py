from itertools import pairwise

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.errors import InputError
from loco_drake.control.ground_path import ground_pose, path_velocity
from loco_drake.control.plan import PLAN_DT, UPDATE_PERIOD, plan_from_motion
from loco_drake.control.retiming import PathLimits, path_limits
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.systems.control import PlanPlayer
from loco_drake.systems.reference_generator import ReferenceGenerator
from loco_drake.systems.scenario import GeneratedReference, SteeringConfig
from loco_drake.systems.steering import Steering, command_ranges
from loco_drake.systems.toppra_smoother import ToppraSmoother
from tests.synthetic_motion import synthetic_motion
from tests.tiny_model import make_tiny_model

STEP = 1.3  # s, when commands change


def add(builder, name, system, plan):
    builder.AddNamedSystem(name, system)
    builder.Connect(plan, system.GetInputPort("plan"))
    return system


def build(robot, reference, limits=None, steering=True, **options):
    """A reference, steering and a smoother, connected as in a locomotion diagram."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("reference", reference)
    chain = [reference]
    if steering:
        config = SteeringConfig(measured_ranges=False, **options)
        system = Steering(robot, config)
        chain.append(add(builder, "steering", system, reference.GetOutputPort("plan")))
        builder.ExportInput(system.GetInputPort("command"), "command")
        builder.ExportOutput(system.GetOutputPort("followed"), "followed")
        if config.tell:
            told = system.GetOutputPort("told")
            builder.Connect(told, reference.GetInputPort("command"))
    smoother = ToppraSmoother(robot, limits=limits)
    add(builder, "smoother", smoother, chain[-1].GetOutputPort("plan"))
    for system in chain:
        for name in ("path_time", "fixed_time", "clock_rate"):
            if system.HasInputPort(name):
                builder.Connect(smoother.GetOutputPort(name), system.GetInputPort(name))
    if reference.HasInputPort("gait"):
        builder.ExportInput(reference.GetInputPort("gait"), "gait")
    builder.ExportOutput(smoother.GetOutputPort("plan"), "plan")
    return builder.Build()


def is_slow(plan):
    """Whether TOPP-RA has slowed a plan down by 3 %."""
    written = plan.path_time[-1] - plan.path_time[0]
    return written < 0.97 * (plan.end_time - plan.start_time)


@pytest.fixture(scope="module")
def model():
    return make_tiny_model()


@pytest.fixture(scope="module")
def long_trot(go2):
    return plan_from_motion(go2, synthetic_motion("dog-trot", 12.0, 0.7))


@pytest.fixture(scope="module")
def played(go2, long_trot):
    return build(go2, PlanPlayer(go2, long_trot))


def sample_of(diagram, context, time):
    plan = diagram.GetOutputPort("plan").Eval(context)
    return plan.q[round((time - plan.start_time) / PLAN_DT)]


def run(diagram, commands, end, context=None, gaits=()):
    """Plays; returns q of each sample when it is due, and the plans at each update."""
    simulator = Simulator(diagram, context)
    context = simulator.get_mutable_context()
    q, plans = [], []
    begin = round(context.get_time() / PLAN_DT)
    for k in range(begin, round(end / PLAN_DT)):
        for name, table in (("command", commands), ("gait", gaits)):
            due = [value for time, value in table if time <= k * PLAN_DT + 1e-9]
            if due:
                diagram.GetInputPort(name).FixValue(context, np.atleast_1d(due[-1]))
        simulator.AdvanceTo(k * PLAN_DT)
        q.append(sample_of(diagram, context, k * PLAN_DT))
        plans.append(diagram.GetOutputPort("plan").Eval(context))
    return np.array(q), plans


def test_without_a_command_the_plan_itself_passes(go2, long_trot):
    """The same object: not a bit of it can differ."""
    builder = DiagramBuilder()
    player = builder.AddNamedSystem("player", PlanPlayer(go2, long_trot))
    steering = add(builder, "steering", Steering(go2), player.GetOutputPort("plan"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.0)
    context = steering.GetMyContextFromRoot(simulator.get_context())
    assert steering.GetOutputPort("plan").Eval(context) is long_trot
    np.testing.assert_array_equal(steering.GetOutputPort("followed").Eval(context), 0)


def test_without_a_command_generated_motion_is_as_without_steering(go2, model):
    runs = []
    for steering in (True, False):
        reference = ReferenceGenerator(go2, GeneratedReference(), model)
        runs.append(run(build(go2, reference, steering=steering), [], 4.0)[0])
    np.testing.assert_array_equal(*runs)


def test_the_plan_follows_a_step_of_the_command_within_a_second(played):
    commands = [(0.0, [0.7, 0.0, 0.0]), (STEP, [0.3, 0.1, 0.8])]
    q, _ = run(played, commands, 4.0)
    velocity = path_velocity(ground_pose(q))
    before, after = slice(40, 60), slice(round((STEP + 1.0) / PLAN_DT), None)
    np.testing.assert_allclose(velocity[before].mean(axis=0), [0.7, 0, 0], atol=0.03)
    np.testing.assert_allclose(velocity[after].mean(axis=0), [0.3, 0.1, 0.8], atol=0.03)


def tight(robot):
    """Limits that the smoother keeps by slowing a trot."""
    limits = path_limits(robot)
    acceleration = limits.acceleration.copy()
    acceleration[:12] *= 0.08
    return PathLimits(limits.speed, acceleration)


def test_a_plan_that_is_slowed_moves_as_commanded(go2, long_trot):
    """In seconds that pass, of which its clock counts fewer."""
    command = [0.6, 0.05, 0.3]
    diagram = build(go2, PlanPlayer(go2, long_trot), tight(go2))
    q, plans = run(diagram, [(0.0, command)], 6.0)
    plan = plans[-1]
    assert np.diff(plan.path_time).mean() < 0.96 * PLAN_DT
    velocity = path_velocity(ground_pose(q))[100:]
    np.testing.assert_allclose(velocity.mean(axis=0), command, atol=0.012)


@pytest.mark.parametrize("slow", [False, True])
def test_the_first_sample_that_differs_is_due_within_three_tenths(go2, long_trot, slow):
    """Also while TOPP-RA is slowing the plan."""
    limits = tight(go2) if slow else path_limits(go2)
    diagram = build(go2, PlanPlayer(go2, long_trot), limits)
    ours, plans = run(diagram, [(0.0, [0.6, 0.0, 0.0])], 2.5)
    if slow:
        assert is_slow(plans[-1])
    # At any phase of the updates.
    for late in range(4):
        time = STEP + late * PLAN_DT
        commands = [(0.0, [0.6, 0.0, 0.0]), (time, [0.0, 0.0, 0.0])]
        theirs, _ = run(diagram, commands, 2.5)
        first = np.flatnonzero((ours != theirs).any(axis=1))[0] * PLAN_DT
        assert time + UPDATE_PERIOD <= first <= time + 0.3


def test_nothing_that_is_fixed_changes(played):
    """Each plan agrees with the one before as far as the next two updates."""
    commands = [(0.24 * k, [0.3 * (k % 3), 0.0, (-1.0) ** k]) for k in range(12)]
    _, plans = run(played, commands, 3.0)
    ahead = round(UPDATE_PERIOD / PLAN_DT)
    for k, (old, new) in enumerate(pairwise(plans)):
        here, there = (round(k - p.start_time / PLAN_DT) for p in (old, new))
        np.testing.assert_array_equal(
            old.q[here : here + ahead], new.q[there : there + ahead]
        )


def test_what_is_played_is_smooth(played, long_trot):
    commands = [(0.24 * k, [0.3 * (k % 3), 0.0, (-1.0) ** k]) for k in range(12)]
    q, _ = run(played, commands, 3.0)
    steps = np.abs(np.diff(q[:, 7:], axis=0)).max()
    assert steps < 2.5 * np.abs(np.diff(long_trot.q[:, 7:], axis=0)).max()
    jolt = np.abs(np.diff(q[:, 4:7], n=2, axis=0)).max() / PLAN_DT**2
    assert jolt < 25.0  # m/s^2; a change of .6 m/s within .6 s


@pytest.mark.parametrize("slow", [False, True])
def test_another_gait_is_written_from_the_next_tokens_on(go2, model, slow):
    """Also while TOPP-RA is slowing the plan."""
    pace = GeneratedReference(gait="dog-pace")
    limits = tight(go2) if slow else path_limits(go2)
    diagram = build(go2, ReferenceGenerator(go2, pace, model), limits)
    q, plans = run(diagram, [], 3.0, gaits=[(0.0, 0.0), (STEP, 1.0)])
    labels = np.array(
        [p.labels[round(k - p.start_time * 50)] for k, p in enumerate(plans)]
    )
    first = np.flatnonzero(labels == 1)[0] * PLAN_DT
    # Three updates, one token of .08 s and a frame; of the plan, .1 s and the token,
    # which last seven times as long where it is slowed so much.
    assert STEP + 0.2 < first <= STEP + (1.6 if slow else 0.55)
    if slow:
        assert is_slow(plans[-1])
    assert (labels[round(first / PLAN_DT) :] == 1).all()
    # It is the same motion up to there, and goes on without a jump.
    same, _ = run(diagram, [], 3.0, gaits=[(0.0, 0.0)])
    differs = np.flatnonzero((q != same).any(axis=1))[0] * PLAN_DT
    assert differs >= STEP + 0.2
    step = np.abs(np.diff(q[:, 4:], axis=0)).max(axis=1)
    around = slice(round(STEP / PLAN_DT), round((STEP + 0.6) / PLAN_DT))
    assert step[around].max() <= 1.5 * step.max()


@pytest.fixture(scope="module")
def telling(go2):
    """A diagram for each way of steering a generator that can be told velocities."""
    model = make_tiny_model(told=True)
    return {
        (bend, tell): build(
            go2,
            ReferenceGenerator(go2, GeneratedReference(), model),
            bend=bend,
            tell=tell,
        )
        for bend in (False, True)
        for tell in (False, True)
    }


def test_without_a_command_nothing_is_told(telling):
    runs = [run(diagram, [], 2.0)[0] for diagram in telling.values()]
    for other in runs[1:]:
        np.testing.assert_array_equal(runs[0], other)


def test_a_plan_is_bent_and_its_generator_told_as_is_wanted(telling):
    """What is told comes later than what is bent, which begins as it would alone."""
    commands = [(STEP, [0.4, 0.0, 0.9])]
    without = run(telling[False, False], [], 3.0)[0]
    found = {way: run(d, commands, 3.0)[0] for way, d in telling.items()}
    np.testing.assert_array_equal(found[False, False], without)
    assert (found[True, True] != found[True, False]).any()
    bent, told, both = (
        np.flatnonzero((found[way] != without).any(axis=1))[0]
        for way in ((True, False), (False, True), (True, True))
    )
    assert bent == both < told <= bent + round(0.4 / PLAN_DT)


@pytest.mark.parametrize("at", [STEP + 0.02, STEP + 0.2, STEP + 0.5])
def test_a_clone_goes_on_identically_while_it_is_told(telling, at):
    commands = [(0.0, [0.4, 0.0, 0.0]), (STEP, [0.4, 0.0, 0.9])]
    diagram = telling[True, True]
    context = diagram.CreateDefaultContext()
    run(diagram, commands, at, context)
    clone = context.Clone()
    ours, _ = run(diagram, commands, 3.0, context)
    theirs, _ = run(diagram, commands, 3.0, clone)
    np.testing.assert_array_equal(ours, theirs)
    diagram.SetDefaultContext(context)
    context.SetTime(0.0)
    again, _ = run(diagram, commands, 3.0, context)
    np.testing.assert_array_equal(ours, again[-len(ours) :])


def test_a_command_that_is_only_told_must_be_finite_too(telling):
    diagram = telling[False, True]
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("command").FixValue(context, [np.nan] * 3)
    with pytest.raises(InputError, match="three finite numbers"):
        simulator.AdvanceTo(0.5)


@pytest.mark.parametrize("at", [STEP + 0.02, STEP + 0.11, STEP + 0.3])
def test_a_clone_in_the_middle_of_a_turn_goes_on_identically(go2, model, at):
    diagram = build(go2, ReferenceGenerator(go2, GeneratedReference(), model))
    commands = [(0.0, [0.4, 0.0, 0.0]), (STEP, [0.4, 0.0, 0.9])]
    gaits = [(0.0, 0.0), (STEP, 1.0)]
    context = diagram.CreateDefaultContext()
    run(diagram, commands, at, context, gaits)
    clone = context.Clone()
    ours, _ = run(diagram, commands, 4.0, context, gaits)
    theirs, _ = run(diagram, commands, 4.0, clone, gaits)
    np.testing.assert_array_equal(ours, theirs)


def test_a_reset_context_repeats_a_drive(played):
    commands = [(0.0, [0.5, 0.1, 0.0]), (STEP, [0.2, 0.0, 0.9])]
    context = played.CreateDefaultContext()
    first, _ = run(played, commands, 3.0, context)
    played.SetDefaultContext(context)
    context.SetTime(0.0)
    again, _ = run(played, commands, 3.0, context)
    np.testing.assert_array_equal(first, again)


def test_another_plan_is_steered_from_its_beginning(go2, long_trot):
    """A player that gets another plan plays it at once, steered as before."""
    player = PlanPlayer(go2, long_trot)
    diagram = build(go2, player)
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("command").FixValue(context, [0.4, 0.0, 0.5])
    simulator.AdvanceTo(2.0)
    pace = plan_from_motion(go2, synthetic_motion("dog-pace", 6.0, 0.9), 2.0)
    player.SetPlan(player.GetMyMutableContextFromRoot(context), pace)
    simulator.AdvanceTo(4.5)
    plan = diagram.GetOutputPort("plan").Eval(context)
    assert (plan.labels[plan.index(4.0) :] == pace.labels[0]).all()
    velocity = path_velocity(ground_pose(plan.q))[plan.index(3.8) : plan.index(4.5)]
    np.testing.assert_allclose(velocity.mean(axis=0), [0.4, 0.0, 0.5], atol=0.05)


def test_the_port_tells_what_is_followed(played):
    simulator = Simulator(played)
    context = simulator.get_mutable_context()
    port = played.GetInputPort("command").FixValue(context, [0.5, 0.0, 0.4])
    simulator.AdvanceTo(0.5)
    followed = played.GetOutputPort("followed")
    np.testing.assert_allclose(followed.Eval(context), [0.5, 0.0, 0.4])
    port.GetMutableData().get_mutable_value().set_value([9.0, 0.0, 0.4])
    simulator.AdvanceTo(1.0)
    assert 0.7 < followed.Eval(context)[0] < 4.0


def test_commands_keep_the_published_range_of_their_gait(go2, long_trot):
    published = command_ranges(go2)[long_trot.labels[0]]
    builder = DiagramBuilder()
    player = builder.AddNamedSystem("player", PlanPlayer(go2, long_trot))
    steering = add(builder, "steering", Steering(go2), player.GetOutputPort("plan"))
    simulator = Simulator(builder.Build())
    context = steering.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    steering.GetInputPort("command").FixValue(context, [0.8, 0.0, 9.0])
    simulator.AdvanceTo(0.5)
    followed = steering.GetOutputPort("followed").Eval(context)
    np.testing.assert_array_equal(followed, published.clip(np.array([0.8, 0.0, 9.0])))
    assert 0.2 < followed[2] < 2.0


@pytest.mark.parametrize("robot", ["go2", "a1"])
def test_every_gait_has_a_published_range_around_its_own_pace(robot):
    ranges = command_ranges(get_robot(robot))
    assert sorted(ranges) == list(range(len(LABELS)))
    for within in ranges.values():
        assert within.low[0] <= within.high[0]
        assert within.high[0] > 0
        assert within.low[2] == -within.high[2]


def test_bad_input_is_refused(go2, played):
    with pytest.raises(InputError, match="response must be a number"):
        Steering(go2, SteeringConfig(response=0.0))
    simulator = Simulator(played)
    context = simulator.get_mutable_context()
    played.GetInputPort("command").FixValue(context, [0.5, np.nan, 0.4])
    with pytest.raises(InputError, match="three finite numbers"):
        simulator.AdvanceTo(0.5)
