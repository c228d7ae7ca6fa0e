import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_error
from loco_drake.control.plan import PLAN_DT, first_change
from loco_drake.motion.gaits import parse_label
from loco_drake.systems.reference_generator import ReferenceGenerator
from loco_drake.systems.scenario import GeneratedReference
from loco_drake.systems.toppra_smoother import ToppraSmoother
from tests.tiny_model import make_tiny_model

PACE, TROT = parse_label("dog-pace").index, parse_label("dog-trot").index


@pytest.fixture(scope="module")
def model():
    return make_tiny_model()


@pytest.fixture(scope="module")
def generator(go2, model):
    return ReferenceGenerator(go2, GeneratedReference(seed=3), model)


def plan_at(system, context):
    return system.GetOutputPort("plan").Eval(context)


def samples(system, duration, every=0.25):
    """Plays ``duration`` s; returns q and v of each sample, by its number."""
    simulator = Simulator(system)
    context = simulator.get_context()
    q, v = {}, {}
    for time in np.arange(0, duration + 1e-9, every):
        simulator.AdvanceTo(time)
        plan = plan_at(system, context)
        first = round(plan.start_time / PLAN_DT)
        for k in range(len(plan)):
            np.testing.assert_array_equal(q.setdefault(first + k, plan.q[k]), plan.q[k])
            v.setdefault(first + k, plan.v[k])
    keys = sorted(q)
    assert keys == list(range(len(keys)))  # no gap, no sample twice
    return np.array([q[k] for k in keys]), np.array([v[k] for k in keys])


def test_plans_are_continuous_across_chunks_and_never_change(generator, model):
    """Velocities are central differences everywhere, also where chunks meet."""
    q, v = samples(generator, 5.0)
    assert len(q) > 5 * model.chunk_frames
    moving = (q[2:, 4:] - q[:-2, 4:]) / (2 * PLAN_DT)
    np.testing.assert_allclose(v[1:-1, 3:], moving, atol=1e-6)
    turning = quat_error(q[:-2, :4], q[2:, :4]) / (2 * PLAN_DT)
    np.testing.assert_allclose(v[1:-1, :3], turning, atol=1e-6)


def test_it_writes_ahead_and_forgets_what_is_long_past(generator):
    simulator = Simulator(generator)
    for time in (0.0, 2.0, 9.0):
        simulator.AdvanceTo(time)
        plan = plan_at(generator, simulator.get_context())
        assert plan.end_time >= time + 2.9
        assert plan.start_time <= max(0.0, time - 0.9)
        assert plan.open_ended
    assert plan.start_time >= 9.0 - 3.0


def test_it_waits_for_a_smoother_that_is_slow(generator):
    simulator = Simulator(generator)
    context = simulator.get_mutable_context()
    generator.GetInputPort("path_time").FixValue(context, 0.0)
    simulator.Initialize()
    before = plan_at(generator, context)
    simulator.AdvanceTo(5.0)
    assert plan_at(generator, context) is before


def test_a_new_gait_holds_from_the_next_token_on(generator, model):
    simulator = Simulator(generator)
    context = simulator.get_mutable_context()
    port = generator.GetInputPort("gait").FixValue(context, float(TROT))
    simulator.AdvanceTo(1.0)
    before = plan_at(generator, context)
    port.GetMutableData().get_mutable_value().set_value([float(PACE)])
    simulator.AdvanceTo(1.06)  # the update is at 1.04 s
    after = plan_at(generator, context)
    first = int(np.argmax(after.labels == PACE))
    assert (after.labels[:first] == TROT).all()
    assert (after.labels[first:] == PACE).all()
    late = after.start_time + first * PLAN_DT - 1.04
    assert 0.1 <= late <= 0.1 + (model.frames_per_token + 1) * PLAN_DT
    # A frame belongs to the token whose features it comes from, one frame earlier.
    np.testing.assert_array_equal(after.q[: first - 1], before.q[: first - 1])
    simulator.AdvanceTo(2.0)
    np.testing.assert_array_equal(plan_at(generator, context).q[: len(after)], after.q)
    v = plan_at(generator, context).v[1:-1, 3:]
    q = plan_at(generator, context).q[:, 4:]
    np.testing.assert_allclose(v, (q[2:] - q[:-2]) / (2 * PLAN_DT), atol=1e-6)


def test_a_schedule_is_kept_to_a_token(go2, model):
    """However far ahead it writes, a gait begins when it is due on the plan's clock."""
    config = GeneratedReference(gait="dog-pace,dog-trot@1.5,dog-pace@4", seed=3)
    generator = ReferenceGenerator(go2, config, model)
    simulator = Simulator(generator)
    labels = {}
    for time in (0.0, 1.0, 2.0):
        simulator.AdvanceTo(time)
        plan = plan_at(generator, simulator.get_context())
        first = round(plan.start_time / PLAN_DT)
        labels |= {first + k: label for k, label in enumerate(plan.labels)}
    changes = [k for k in sorted(labels)[1:] if labels[k] != labels[k - 1]]
    late = np.array(changes) * PLAN_DT - [1.5, 4.0]
    assert (late >= 0).all()
    assert (late <= (model.frames_per_token + 1) * PLAN_DT).all()
    assert [labels[0], labels[changes[0]], labels[changes[1]]] == [PACE, TROT, PACE]
    generator.SetReference(simulator.get_mutable_context(), gait="dog-trot", seed=3)
    assert (plan_at(generator, simulator.get_context()).labels == TROT).all()


@pytest.mark.parametrize("how", ["schedule", "port"])
def test_clones_and_resets_repeat_a_change_of_gait(how, go2, model):
    """To the last bit, also when the context is cloned in the middle of it."""
    gait = "dog-pace,dog-trot@2" if how == "schedule" else "dog-pace"
    generator = ReferenceGenerator(go2, GeneratedReference(gait=gait), model)

    def run(context, end):
        simulator = Simulator(generator, context)
        if how == "port":
            now = np.arange(context.get_time(), end, 0.1)
            for time in now:
                label = PACE if time < 1.05 else TROT
                generator.GetInputPort("gait").FixValue(context, float(label))
                simulator.AdvanceTo(min(time + 0.1, end))
        simulator.AdvanceTo(end)
        return plan_at(generator, context)

    context = generator.CreateDefaultContext()
    run(context, 1.0)
    clone = context.Clone()
    ours = run(context, 6.0)
    theirs = run(clone, 6.0)
    assert ours is not theirs
    np.testing.assert_array_equal(ours.state, theirs.state)
    assert ours.labels[-1] == TROT
    generator.SetDefaultContext(context)
    context.SetTime(0.0)
    again = run(context, 6.0)
    np.testing.assert_array_equal(ours.state, again.state)


@pytest.fixture(scope="module")
def told(go2):
    """A generator that can be told velocities."""
    model = make_tiny_model(told=True)
    return ReferenceGenerator(go2, GeneratedReference(seed=3), model)


def tell(system, context, command):
    system.GetInputPort("command").FixValue(context, command)


def test_without_a_command_it_writes_as_one_that_cannot_be_told(generator, told):
    q, _ = samples(generator, 2.0)
    np.testing.assert_array_equal(samples(told, 2.0)[0], q)
    simulator = Simulator(told)
    tell(told, simulator.get_mutable_context(), [np.nan] * 3)
    simulator.AdvanceTo(2.0)
    plan = plan_at(told, simulator.get_context())
    first = round(plan.start_time / PLAN_DT)
    np.testing.assert_array_equal(plan.q, q[first:][: len(plan)])


def test_a_new_command_is_told_from_the_next_token_on(told, model):
    simulator = Simulator(told)
    context = simulator.get_mutable_context()
    tell(told, context, [0.5, 0.0, 0.0])
    simulator.AdvanceTo(1.0)
    before = plan_at(told, context)
    tell(told, context, [0.5, 0.0, 0.9])
    simulator.AdvanceTo(1.06)  # the update is at 1.04 s
    after = plan_at(told, context)
    late = first_change(before, after) - 1.04
    assert 0.1 <= late <= 0.1 + (model.frames_per_token + 1) * PLAN_DT
    v, q = after.v[1:-1, 3:], after.q[:, 4:]
    np.testing.assert_allclose(v, (q[2:] - q[:-2]) / (2 * PLAN_DT), atol=1e-6)


def test_small_changes_of_a_command_are_not_told(told):
    """Within .05 of what was told last, however many there are; then it is told."""
    simulator = Simulator(told)
    context = simulator.get_mutable_context()
    tell(told, context, [0.5, 0.0, 0.0])
    simulator.AdvanceTo(0.3)
    plan = plan_at(told, context)
    for k in range(1, 6):
        tell(told, context, [0.5, 0.0, 0.01 * k - 0.001])
        simulator.AdvanceTo(0.3 + 0.08 * k)
    assert first_change(plan, plan_at(told, context)) > plan.path_time[-1]
    tell(told, context, [0.5, 0.0, 0.051])
    simulator.AdvanceTo(0.9)
    assert first_change(plan, plan_at(told, context)) < plan.path_time[-1]


def test_clones_and_resets_repeat_what_was_told(told):
    """To the last bit, also when the context is cloned on the way."""

    def run(context, end):
        simulator = Simulator(told, context)
        for time in np.arange(context.get_time(), end, 0.1):
            tell(told, context, [0.5, 0.0, 0.0 if time < 1.05 else 0.8])
            simulator.AdvanceTo(min(time + 0.1, end))
        return plan_at(told, context)

    context = told.CreateDefaultContext()
    run(context, 1.3)
    clone = context.Clone()
    ours, theirs = run(context, 4.0), run(clone, 4.0)
    assert ours is not theirs
    np.testing.assert_array_equal(ours.state, theirs.state)
    told.SetDefaultContext(context)
    context.SetTime(0.0)
    np.testing.assert_array_equal(run(context, 4.0).state, ours.state)


def test_a_command_that_is_none_is_refused(told, generator):
    for system, command, message in (
        (told, [0.5, np.nan, 0.0], "three finite numbers"),
        (told, [0.5, np.inf, 0.0], "three finite numbers"),
        (generator, [0.5, 0.0, 0.0], "not taught velocities"),
    ):
        simulator = Simulator(system)
        tell(system, simulator.get_mutable_context(), command)
        with pytest.raises(InputError, match=message):
            simulator.AdvanceTo(0.5)


@pytest.mark.parametrize("gait", [99.0, -1.0, 3.7, -0.5, 0.001, 7.0, np.inf])
def test_a_gait_that_is_none_is_refused_by_the_port(generator, gait):
    """With the error itself: what AdvanceTo raises is what the system raised."""
    simulator = Simulator(generator)
    context = simulator.get_mutable_context()
    generator.GetInputPort("gait").FixValue(context, gait)
    with pytest.raises(InputError, match="a gait, 0 dog-pace, 1 dog-trot; not "):
        simulator.AdvanceTo(2.0)


def test_seed_and_gait_can_be_set_in_a_context(generator):
    context = generator.CreateDefaultContext()
    default = plan_at(generator, context)
    generator.SetReference(context, gait="dog-trot", seed=4)
    other = plan_at(generator, context)
    assert (other.q != default.q).any()
    generator.SetReference(context, gait="dog-trot", seed=3)
    np.testing.assert_array_equal(plan_at(generator, context).q, default.q)
    generator.SetReference(context, gait="dog-pace", seed=3)
    assert (plan_at(generator, context).labels == PACE).all()


def test_a_cloned_context_writes_the_same(go2, model):
    builder = DiagramBuilder()
    generator = builder.AddNamedSystem(
        "generator", ReferenceGenerator(go2, GeneratedReference(), model)
    )
    smoother = builder.AddNamedSystem("smoother", ToppraSmoother(go2))
    builder.Connect(generator.GetOutputPort("plan"), smoother.GetInputPort("plan"))
    builder.Connect(
        smoother.GetOutputPort("path_time"), generator.GetInputPort("path_time")
    )
    builder.ExportOutput(smoother.GetOutputPort("plan"), "plan")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.05)
    clone = Simulator(diagram, simulator.get_context().Clone())
    simulator.AdvanceTo(4.0)
    clone.AdvanceTo(4.0)
    ours = plan_at(diagram, simulator.get_context())
    theirs = plan_at(diagram, clone.get_context())
    assert ours is not theirs
    np.testing.assert_array_equal(ours.state, theirs.state)
    assert ours.end_time > 4.9  # neither waits for the other for ever


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"gait": "dog-waltz"}, "dog-pace, dog-trot"),
        ({"gait": "any"}, "Unknown gait 'any'; the choices are dog-pace, dog-"),
        ({"gait": "horse-walk"}, "not trained on horse-walk"),
        ({"gait": "dog-trot,horse-walk@30"}, "not trained on horse-walk"),
        ({"gait": "dog-trot,dog-pace@3,dog-trot@2"}, "rising times"),
        ({"seed": -1}, "seed must be 0 or more"),
        ({"duration": 0.0}, "duration must be a number of at least 0.02"),
        ({"duration": float("nan")}, "duration must be a number of at least 0.02"),
        ({"temperature": -1.0}, "temperature"),
        ({"top_p": 0.0}, "top_p"),
    ],
)
def test_bad_input_is_refused(go2, model, config, message):
    with pytest.raises(InputError, match=message):
        ReferenceGenerator(go2, GeneratedReference(**config), model)
