"""Make the robot walk to a point and turn to it, by feedback of its state.

A system of one's own reads the state of the robot and writes the command. Prints the
distance from the point each second.
"""

from math import atan2, cos, hypot, pi, sin

import numpy as np
import tyro
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Meshcat
from pydrake.math import RollPitchYaw
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem

import loco_drake as ld


class GoToPoint(LeafSystem):
    """Commands a velocity towards a point, and to face it until it is near."""

    def __init__(self, x: float, y: float, size: int, speed: float) -> None:
        super().__init__()
        self._point, self._speed = np.array([x, y]), speed
        self._state = self.DeclareVectorInputPort("state", size)
        self.DeclareVectorOutputPort("command", 3, self._calc)

    def _calc(self, context: Context, command: BasicVector) -> None:
        state = self._state.Eval(context)
        yaw = RollPitchYaw(Quaternion(state[:4])).yaw_angle()
        ahead_x, ahead_y = self._point - state[4:6]
        distance = hypot(ahead_x, ahead_y)
        bearing = (atan2(ahead_y, ahead_x) - yaw + pi) % (2 * pi) - pi
        speed = min(self._speed, distance)
        turn = np.clip(2 * bearing, -1.0, 1.0) if distance > 0.3 else 0.0
        command.SetFromVector([speed * cos(bearing), speed * sin(bearing), turn])


def go_to_point(
    x: float = 3.0,
    y: float = 2.0,
    gait: str = "mpc-trot",
    speed: float = 0.8,
    duration: float = 12.0,
    robot: str = "go2",
    meshcat: bool = False,
) -> None:
    """Simulates ``duration`` seconds on the way to (``x``, ``y``), m."""
    scenario = ld.LoadScenario(
        data=f"{{robot: {robot}, reference: !GeneratedReference {{gait: {gait}}}}}"
    )
    scenario.plant.visual = meshcat
    scenario.simulator.target_realtime_rate = 1.0 if meshcat else 0.0
    builder = DiagramBuilder()
    made = ld.AddLocomotion(builder, scenario, meshcat=Meshcat() if meshcat else None)
    state = made.outputs["state"]
    guide = builder.AddSystem(GoToPoint(x, y, state.size(), speed))
    builder.Connect(state, guide.GetInputPort("state"))
    builder.Connect(guide.GetOutputPort("command"), made.inputs["command"])
    builder.ExportOutput(state, "state")
    diagram = builder.Build()
    simulator = ld.MakeSimulator(diagram, scenario)
    ld.StartEpisode(simulator)
    for second in range(1, round(duration) + 1):
        simulator.AdvanceTo(second)
        q = diagram.GetOutputPort("state").Eval(simulator.get_context())
        print(f"{second:3} s  {hypot(x - q[4], y - q[5]):.2f} m from the point")


if __name__ == "__main__":
    tyro.cli(go_to_point)
