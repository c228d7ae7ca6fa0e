import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from loco_drake.control.driving import OrderTable
from loco_drake.control.plan import PLAN_DT
from loco_drake.evaluation.tracking import Recorder
from loco_drake.systems.command_source import CommandSource
from loco_drake.systems.scenario import Scenario
from loco_drake.systems.simulator import MakeSimulator


def count(time):
    """Orders that are different in every control period."""
    return np.array([time, 2 * time, -time, round(time / PLAN_DT) % 15, 0.0, 0.0])


def outputs(source, context):
    names = ("command", "gait", "events")
    return np.concatenate([source.GetOutputPort(k).Eval(context) for k in names])


def test_the_outputs_are_the_orders_of_the_last_period():
    source = CommandSource(count)
    simulator = Simulator(source)
    context = simulator.get_context()
    np.testing.assert_array_equal(outputs(source, context), count(0.0))
    for k in range(1, 12):
        simulator.AdvanceTo(k * PLAN_DT)
        # The events at this time come with the next step.
        before = count((k - 1) * PLAN_DT)
        np.testing.assert_array_equal(outputs(source, context), before)
        np.testing.assert_array_equal(source.orders(context), before)


def test_the_outputs_depend_on_the_context_alone():
    """A clone goes on with what was sampled, whatever the source says by then."""
    said = [np.zeros(6)]
    source = CommandSource(lambda time: said[-1])
    simulator = Simulator(source)
    said.append(np.array([0.5, 0.0, 0.2, 3.0, 6.0, 1.0]))
    simulator.AdvanceTo(0.1)
    clone = simulator.get_context().Clone()
    said.append(np.zeros(6))
    np.testing.assert_array_equal(outputs(source, clone), said[1])
    simulator.AdvanceTo(0.2)
    np.testing.assert_array_equal(outputs(source, simulator.get_context()), 0)
    np.testing.assert_array_equal(outputs(source, clone), said[1])
    default = source.CreateDefaultContext()
    np.testing.assert_array_equal(outputs(source, default), 0)


def test_a_robot_cloned_in_the_middle_of_a_turn_goes_on_identically():
    rows = np.zeros((3, 6))
    rows[:, 0] = 0.6
    rows[1:, 2] = 0.9, -0.5
    rows[:, 3] = 1.0
    table = OrderTable(np.array([0.0, 0.5, 1.1]), rows)
    recorder = Recorder(Scenario(), source=CommandSource(table.at))
    recorder.start()
    recorder.simulator.AdvanceTo(0.83)
    twin = MakeSimulator(recorder.diagram, Scenario())
    twin.reset_context(recorder.context.Clone())
    ends = []
    for simulator in (recorder.simulator, twin):
        simulator.AdvanceTo(1.6)
        state = recorder.diagram.GetOutputPort("state").Eval(simulator.get_context())
        ends.append(state.copy())
    np.testing.assert_array_equal(*ends)
    # It turned to the left before.
    assert ends[0][3] > 0.05


def test_no_zero_is_negative():
    source = CommandSource(lambda time: np.full(6, -0.0))
    simulator = Simulator(source)
    for time in (0.0, 0.1):
        simulator.AdvanceTo(time)
        assert not np.signbit(outputs(source, simulator.get_context())).any()


def test_what_sampling_raises_is_raised():
    def lost(time):
        if time > 0.05:
            raise RuntimeError("the device is lost")
        return np.zeros(6)

    with pytest.raises(RuntimeError, match="the device is lost"):
        Simulator(CommandSource(lost)).AdvanceTo(0.2)
