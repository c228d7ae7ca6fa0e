import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import loco_drake.systems.gait_selector as module
from loco_drake.common.errors import InputError
from loco_drake.control.command import CommandRange
from loco_drake.control.driving import order_table
from loco_drake.control.gait_choice import MeasuredGait
from loco_drake.control.plan import PLAN_DT, UPDATE_PERIOD
from loco_drake.evaluation.gait_change_time import gait_change_time
from loco_drake.evaluation.steering import stride_velocity
from loco_drake.evaluation.steering_courses import grid
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import ANY_INDEX, LABELS, parse_label
from loco_drake.systems.command_source import CommandSource
from loco_drake.systems.diagram import AddLocomotion, MakeLocomotionDiagram
from loco_drake.systems.gait_selector import GaitSelector, measured_gaits
from loco_drake.systems.reference_generator import ReferenceGenerator
from loco_drake.systems.scenario import GeneratedReference, Scenario
from loco_drake.systems.simulator import MakeSimulator, StartEpisode
from tests.tiny_model import make_tiny_model

SLOW, FAST = parse_label("horse-walk").index, parse_label("dog-trot").index
# The index of a gait that is not the first one, so that none is taken for another.
WAVE = parse_label("solo8-wave").index


@pytest.fixture
def selector(go2, monkeypatch):
    """One gait up to 1 m/s, and one that is worse up to 2 m/s."""

    def gait(high, score):
        within = CommandRange((0.0, -0.1, -0.5), (high, 0.1, 0.5))
        commands = np.array(grid(within))
        return MeasuredGait(within, commands, np.full(len(commands), score))

    gaits = {SLOW: gait(1.0, 1.0), FAST: gait(2.0, 2.0)}
    monkeypatch.setattr(module, "measured_gaits", lambda robot: gaits)
    return GaitSelector(go2, "any")


def gait_of(system, context):
    return system.GetOutputPort("gait").Eval(context)[0]


def play(system, context, until, gait=None, command=None):
    for name, value in (("gait", gait), ("command", command)):
        if value is not None:
            system.GetInputPort(name).FixValue(context, np.atleast_1d(value))
    Simulator(system, context).AdvanceTo(until)
    return gait_of(system, context)


def test_a_gait_that_is_named_passes_at_once(selector):
    context = selector.CreateDefaultContext()
    for label in (WAVE, SLOW, 0):
        selector.GetInputPort("gait").FixValue(context, float(label))
        assert gait_of(selector, context) == label


def test_the_command_chooses_any_gait(selector):
    context = selector.CreateDefaultContext()
    assert play(selector, context, 0.5) == SLOW  # without a command
    assert play(selector, context, 1.0, ANY_INDEX, [1.05, 0.0, 0.0]) == SLOW
    assert play(selector, context, 1.0 + UPDATE_PERIOD, None, [1.2, 0, 0]) == FAST
    # It keeps the new one for a while, and goes on from one that is named.
    assert play(selector, context, 2.0, None, [0.5, 0.0, 0.0]) == FAST
    assert play(selector, context, 6.0, WAVE) == WAVE
    assert play(selector, context, 6.5, ANY_INDEX) == SLOW
    # A command that is not finite is refused elsewhere.
    assert play(selector, context, 7.0, None, [np.nan] * 3) == SLOW


def test_clones_go_on_identically_and_a_reset_begins_anew(selector):
    context = selector.CreateDefaultContext()
    play(selector, context, 1.0, ANY_INDEX, [1.2, 0.0, 0.0])
    clone = context.Clone()
    results = []
    for each in (context, clone):
        values = [
            play(selector, each, time, None, [0.5, 0.0, 0.0])
            for time in np.arange(1.1, 5.0, 0.1)
        ]
        results.append(values)
    assert results[0] == results[1]
    assert set(results[0]) == {SLOW, FAST}
    selector.SetDefaultContext(context)
    assert gait_of(selector, context) == SLOW


def test_without_any_gait_asked_for_it_says_so(go2):
    selector = GaitSelector(go2, "dog-trot")
    context = selector.CreateDefaultContext()
    assert np.isnan(play(selector, context, 0.5, None, [0.4, 0.0, 0.0]))


def test_the_beginning_goes_with_the_command(selector):
    context = selector.CreateDefaultContext()
    assert selector.SetGait(context) == "horse-walk"
    selector.GetInputPort("command").FixValue(context, [1.5, 0.0, 0.0])
    assert selector.SetGait(context, "any") == "dog-trot"
    assert gait_of(selector, context) == FAST
    assert selector.SetGait(context, "dog-pace,dog-trot@3") == "dog-pace,dog-trot@3"
    assert np.isnan(gait_of(selector, context))


@pytest.mark.parametrize("gait", [-2.0, 1.5, 15.0, np.inf, np.nan])
def test_what_is_no_gait_is_refused(selector, gait):
    context = selector.CreateDefaultContext()
    selector.GetInputPort("gait").FixValue(context, gait)
    with pytest.raises(InputError, match=r"-1 any, 0 dog-pace, .*14 solo8-wave; not"):
        gait_of(selector, context)


def test_a_robot_that_was_not_measured_is_refused(go2, monkeypatch, tmp_path):
    path = tmp_path / "steering-go2.json"
    monkeypatch.setattr(module, "results_path", lambda name: path)
    with pytest.raises(InputError, match="run loco-drake evaluate steering --robot go"):
        GaitSelector(go2, "any")
    GaitSelector(go2, "dog-trot")


@pytest.mark.parametrize("name", ["go2", "a1"])
def test_every_gait_of_the_results_can_be_chosen_from(name):
    gaits = measured_gaits(get_robot(name))
    assert sorted(gaits) == list(range(len(LABELS)))
    for gait in gaits.values():
        assert 0.3 < gait.score(gait.range.middle) < 30


def test_a_generator_without_an_order_does_as_configured(go2):
    """Not a bit of it changes, whether a selector is connected or not."""
    model = make_tiny_model()
    config = GeneratedReference(gait="dog-pace,dog-trot@1")
    plans = []
    for value in (None, np.nan):
        generator = ReferenceGenerator(go2, config, model)
        simulator = Simulator(generator)
        context = simulator.get_mutable_context()
        if value is not None:
            generator.GetInputPort("gait").FixValue(context, value)
        simulator.AdvanceTo(2.0)
        plans.append(generator.GetOutputPort("plan").Eval(context))
    np.testing.assert_array_equal(plans[0].q, plans[1].q)
    assert set(plans[0].labels) == {0, 1}


CHANGE = 2.5  # s
END = 7.5


@pytest.fixture(scope="module")
def driven():
    """The Go2 that is to step on the spot and from 2.5 s on to run at 1.5 m/s."""
    rows = [[0, 0, 0, ANY_INDEX, 0, 0], [1.5, 0, 0, ANY_INDEX, 0, 0]]
    table = order_table([0.0, CHANGE], [np.array(row, float) for row in rows])
    scenario = Scenario(reference=GeneratedReference(gait="any"))
    builder = DiagramBuilder()
    made = AddLocomotion(builder, scenario)
    source = builder.AddNamedSystem("source", CommandSource(table.at))
    for name in ("command", "gait"):
        builder.Connect(source.GetOutputPort(name), made.inputs.pop(name))
    made.ExportPorts(builder)
    diagram = builder.Build()
    simulator = MakeSimulator(diagram, scenario)
    StartEpisode(simulator)
    return diagram, scenario, simulator


def advance(diagram, simulator, until):
    """Returns state and label of the plan at each sample."""
    context = simulator.get_context()
    states, labels = [], []
    for k in range(round(context.get_time() / PLAN_DT), round(until / PLAN_DT)):
        simulator.AdvanceTo((k + 1) * PLAN_DT)
        states.append(diagram.GetOutputPort("state").Eval(context))
        plan = diagram.GetOutputPort("plan").Eval(context)
        labels.append(plan.labels[plan.index(context.get_time())])
    return np.array(states), np.array(labels)


def test_a_robot_that_is_to_run_changes_its_gait_follows_and_stands(go2, driven):
    """And a clone of the Context in the middle of the change does the same."""
    diagram, scenario, simulator = driven
    before, standing = advance(diagram, simulator, CHANGE + 0.3)
    clone = MakeSimulator(diagram, scenario)
    clone.reset_context(simulator.get_context().Clone())
    clone.Initialize()
    states, labels = advance(diagram, simulator, END)
    np.testing.assert_array_equal(states, advance(diagram, clone, END)[0])
    slow, fast = standing[0], labels[-1]
    all_states = np.concatenate((before, states))
    all_labels = np.concatenate((standing, labels))
    changed = round(CHANGE / PLAN_DT)
    command = np.array([1.5, 0.0, 0.0])
    assert gait_change_time(go2, all_states, all_labels, changed, command) < 2.5
    assert slow != fast
    # Within half a second, and once.
    assert (standing == slow).all()
    assert (labels[round(0.3 / PLAN_DT) :] == fast).all()
    assert all_states[:, 6].min() > 0.7 * go2.stand_height
    velocity = stride_velocity(go2, all_states)
    still, running = velocity[50:100], velocity[-100:]
    np.testing.assert_allclose(still.mean(axis=0), 0, atol=0.08)
    np.testing.assert_allclose(running.mean(axis=0), command, atol=0.08)


def test_an_episode_of_any_gait_begins_with_that_of_the_command():
    diagram = MakeLocomotionDiagram(Scenario())
    simulator = MakeSimulator(diagram, Scenario())
    context = simulator.get_mutable_context()
    begun = []
    for speed in (0.0, 1.5):
        diagram.GetInputPort("command").FixValue(context, [speed, 0.0, 0.0])
        StartEpisode(simulator, gait="any")
        begun.append(set(diagram.GetOutputPort("plan").Eval(context).labels))
    assert len(begun[0]) == len(begun[1]) == 1
    assert begun[0] != begun[1]
    StartEpisode(simulator)
    (label,) = set(diagram.GetOutputPort("plan").Eval(context).labels)
    assert LABELS[label] == parse_label("dog-trot")
