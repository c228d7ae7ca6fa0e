import numpy as np
import pytest
from pydrake.geometry import Meshcat

from loco_drake.common.gravity import GRAVITY
from loco_drake.models.legs import LEGS
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.drawing import FORCE_SCALE
from loco_drake.systems.scenario import ExternalTargets, Scenario
from loco_drake.systems.simulator import MakeSimulator
from tests.meshcat_messages import animation


def test_arrows_of_a_robot_that_stands_are_as_long_as_its_weight(go2):
    scenario = Scenario(policy=ExternalTargets())
    scenario.visualization.publish_contacts = True
    meshcat = Meshcat()
    simulator = MakeSimulator(
        MakeLocomotionDiagram(scenario, meshcat=meshcat), scenario
    )
    targets = simulator.get_system().GetInputPort("desired_state")
    stance = np.concatenate((go2.stand_joints, np.zeros(12)))
    targets.FixValue(simulator.get_mutable_context(), stance)
    simulator.AdvanceTo(1.0)
    meshcat.StartRecording()
    simulator.AdvanceTo(1.1)
    meshcat.PublishRecording()
    tracks = animation(meshcat.StaticHtml())
    arrow = "/drake/contact_forces/point/{}_calf+world/cylinder"
    lengths = [tracks[arrow.format(leg), ".scale"][-1][1][2] for leg in LEGS]
    assert min(lengths) > 0.03
    weight = go2.mass * GRAVITY
    # Feet push a little to the sides, too.
    assert FORCE_SCALE * sum(lengths) == pytest.approx(weight, rel=0.05)
