"""Whether a robot stands: its motors hold the stance for a while."""

from typing import NamedTuple

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from .plant import AddRobotPlant, ConfigureSimulator, PlantConfig
from .simulated import SimulatedRobot

# Share of the height, rad and m/s; a robot that is held is within a third of each.
_MOST_SUNK, _MOST_TILT, _MOST_SPEED = 0.2, 0.2, 0.02


class Standing(NamedTuple):
    """What became of a robot that was to stand."""

    height: float  # of the stance, m
    sunk: float  # of the trunk from there, m
    tilt: float  # of the trunk, rad
    speed: float  # of the trunk at the end, m/s

    @property
    def stands(self) -> bool:
        """Whether it does."""
        held = abs(self.sunk) < _MOST_SUNK * self.height
        return bool(held and self.tilt < _MOST_TILT and self.speed < _MOST_SPEED)


def stand(robot: SimulatedRobot, seconds: float = 2.0) -> Standing:
    """Simulates a robot whose set-points are those of the stance."""
    config = PlantConfig()
    builder = DiagramBuilder()
    plant, _, instance = AddRobotPlant(builder, robot, config)
    builder.ExportInput(plant.get_desired_state_input_port(instance), "desired_state")
    simulator = Simulator(builder.Build())
    ConfigureSimulator(simulator, config)
    context = simulator.get_mutable_context()
    desired = np.concatenate((robot.stand_joints, np.zeros_like(robot.stand_joints)))
    simulator.get_system().GetInputPort("desired_state").FixValue(context, desired)
    simulator.AdvanceTo(seconds)
    state = plant.GetPositionsAndVelocities(plant.GetMyContextFromRoot(context))
    q, v = np.split(state, [7 + len(robot.joint_names)])
    # The z axis of the trunk against the world's, of a quaternion that has drifted.
    _, x, y, _ = q[:4] / np.linalg.norm(q[:4])
    tilt = float(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0)))
    speed = float(np.linalg.norm(v[3:6]))
    height = robot.stand_height
    return Standing(height, float(height - q[6]), tilt, speed)
