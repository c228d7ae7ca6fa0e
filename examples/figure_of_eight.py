"""Steer the robot along a figure of eight, by a system of one's own.

The port "command" takes forward and sideways velocity and yaw rate. Any system can be
connected to it: this one turns left for a full circle, then right. Prints where the
robot is each second, and how far from the start it ends.
"""

from math import hypot, tau

import tyro
from pydrake.geometry import Meshcat
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem

import loco_drake as ld


class FigureOfEight(LeafSystem):
    """Commands full circles, left and right in turn."""

    def __init__(self, speed: float, yaw_rate: float) -> None:
        super().__init__()
        self._speed, self._yaw_rate = speed, yaw_rate
        self.DeclareVectorOutputPort("command", 3, self._calc, {self.time_ticket()})

    def _calc(self, context: Context, command: BasicVector) -> None:
        circles = int(context.get_time() * self._yaw_rate / tau)
        left = 1 if circles % 2 == 0 else -1
        command.SetFromVector([self._speed, 0.0, left * self._yaw_rate])


def figure_of_eight(
    gait: str = "mpc-trot",
    speed: float = 0.8,
    yaw_rate: float = 0.8,
    robot: str = "go2",
    meshcat: bool = False,
) -> None:
    """Simulates one figure of eight at ``speed`` (m/s) and ``yaw_rate`` (rad/s)."""
    scenario = ld.LoadScenario(
        data=f"{{robot: {robot}, reference: !GeneratedReference {{gait: {gait}}}}}"
    )
    scenario.plant.visual = meshcat
    scenario.simulator.target_realtime_rate = 1.0 if meshcat else 0.0
    builder = DiagramBuilder()
    made = ld.AddLocomotion(builder, scenario, meshcat=Meshcat() if meshcat else None)
    course = builder.AddSystem(FigureOfEight(speed, yaw_rate))
    builder.Connect(course.GetOutputPort("command"), made.inputs["command"])
    builder.ExportOutput(made.outputs["state"], "state")
    diagram = builder.Build()
    simulator = ld.MakeSimulator(diagram, scenario)
    ld.StartEpisode(simulator)
    x = y = 0.0
    for second in range(1, round(2 * tau / yaw_rate) + 1):
        simulator.AdvanceTo(second)
        state = diagram.GetOutputPort("state").Eval(simulator.get_context())
        x, y = state[4:6]
        print(f"{second:3} s  x {x:+.2f} m  y {y:+.2f} m")
    print(f"The robot ends {hypot(x, y):.2f} m from its start.")


if __name__ == "__main__":
    tyro.cli(figure_of_eight)
