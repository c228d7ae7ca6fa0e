"""Change the gait while the robot runs: from a pace to a trot to a horse's walk.

The first change is in the scenario, to the second. The other is made on the way,
through the diagram's input port, and shows within a second. Prints the speed with each
gait.
"""

from math import hypot

import tyro
from pydrake.geometry import Meshcat

import loco_drake as ld
from loco_drake.motion.gaits import LABELS, parse_label

SCENARIO = "{reference: !GeneratedReference {gait: 'dog-pace,dog-trot@4', seed: 3}}"


def change_gait(
    then: str = "horse-walk", duration: float = 16.0, meshcat: bool = False
) -> None:
    """Simulates ``duration`` seconds; ``then`` is asked for in their middle."""
    scenario = ld.LoadScenario(data=SCENARIO)
    scenario.plant.visual = meshcat
    scenario.simulator.target_realtime_rate = 1.0 if meshcat else 0.0
    diagram = ld.MakeLocomotionDiagram(scenario, meshcat=Meshcat() if meshcat else None)
    simulator = ld.MakeSimulator(diagram, scenario)
    context = simulator.get_mutable_context()
    ld.StartEpisode(simulator)
    asked = float(parse_label(then).index)
    gait, distance, seconds, here = None, 0.0, 0, (0.0, 0.0)
    for second in range(1, round(duration) + 1):
        simulator.AdvanceTo(second)
        if second == round(duration / 2):
            diagram.GetInputPort("gait").FixValue(context, asked)
        plan = diagram.GetOutputPort("plan").Eval(context)
        now = LABELS[plan.labels[plan.index(second)]]
        x, y = diagram.GetOutputPort("state").Eval(context)[4:6]
        if now != gait:
            gait, distance, seconds = now, 0.0, 0
        distance, seconds = distance + hypot(x - here[0], y - here[1]), seconds + 1
        here = (x, y)
        print(f"{second:3} s  {gait}, {distance / seconds:.2f} m/s so far")


if __name__ == "__main__":
    tyro.cli(change_gait)
