import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.control.action import ACTION_SCALE
from loco_drake.control.feed_forward import feed_forward_torques
from loco_drake.control.plan import PLAN_DT
from loco_drake.models.robots import get_robot
from loco_drake.systems.control import JointTargets, PlanPlayer


def build(robot, plan):
    builder = DiagramBuilder()
    player = builder.AddNamedSystem("player", PlanPlayer(robot, plan))
    targets = builder.AddNamedSystem("targets", JointTargets(robot))
    builder.Connect(player.GetOutputPort("plan"), targets.GetInputPort("plan"))
    builder.ExportInput(targets.GetInputPort("action"), "action")
    builder.ExportOutput(targets.GetOutputPort("desired_state"), "desired_state")
    builder.ExportOutput(targets.GetOutputPort("action"), "action")
    return builder.Build()


def test_targets_are_the_next_sample_the_action_and_the_feed_forward(go2, trot):
    diagram = build(go2, trot)
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    action = np.linspace(-1, 1, 12)
    diagram.GetInputPort("action").FixValue(context, action)
    simulator.AdvanceTo(20.5 * PLAN_DT)
    desired = diagram.GetOutputPort("desired_state").Eval(context)
    # The last sampling was at sample 20; 100 Nm/rad and 2 Nm s/rad are the Go2's.
    torques = feed_forward_torques(get_robot("go2"), trot)
    expected = trot.q[21, 7:] + ACTION_SCALE * action
    expected += (trot.v[20, 6:] + trot.v[21, 6:] + torques[21]) / 100
    np.testing.assert_allclose(desired[:12], expected, atol=1e-12)
    np.testing.assert_array_equal(desired[12:], 0)
    np.testing.assert_array_equal(diagram.GetOutputPort("action").Eval(context), action)


def test_they_are_held_for_a_control_period(go2, trot):
    diagram = build(go2, trot)
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    port = diagram.GetInputPort("action").FixValue(context, np.zeros(12))
    simulator.AdvanceTo(20.1 * PLAN_DT)
    before = diagram.GetOutputPort("desired_state").Eval(context).copy()
    port.GetMutableData().get_mutable_value().set_value(np.ones(12))
    simulator.AdvanceTo(20.9 * PLAN_DT)
    held = diagram.GetOutputPort("desired_state").Eval(context)
    np.testing.assert_array_equal(held, before)
    simulator.AdvanceTo(21.1 * PLAN_DT)
    assert (diagram.GetOutputPort("desired_state").Eval(context) != before).any()
