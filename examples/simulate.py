"""Build the diagram and simulate it: the Go2 trots like a dog.

Prints its speed. With --meshcat one sees it in the browser, in real time, at the
address that is printed first; the coloured spheres are the plan that it follows.
"""

from math import hypot

import tyro
from pydrake.geometry import Meshcat

import loco_drake as ld

SCENARIO = "{robot: go2, reference: !GeneratedReference {gait: dog-trot, seed: 3}}"


def simulate(duration: float = 10.0, meshcat: bool = False) -> None:
    """Simulates ``duration`` seconds."""
    scenario = ld.LoadScenario(data=SCENARIO)
    scenario.plant.visual = meshcat
    scenario.simulator.target_realtime_rate = 1.0 if meshcat else 0.0
    diagram = ld.MakeLocomotionDiagram(scenario, meshcat=Meshcat() if meshcat else None)
    simulator = ld.MakeSimulator(diagram, scenario)
    ld.StartEpisode(simulator)
    simulator.AdvanceTo(duration)
    x, y = diagram.GetOutputPort("state").Eval(simulator.get_context())[4:6]
    print(f"From start to end: {hypot(x, y) / duration:.2f} m/s")


if __name__ == "__main__":
    tyro.cli(simulate)
