"""What a chunk of generated motion costs in the diagram.

Times are of the process on one thread: processor time, which other work on the machine
lengthens less than the time on the clock, which is printed, too. A chunk is about a
second: tokens, decoding, footing and the plan, as ReferenceGenerator's event does it
while a simulation runs. The smoother re-times a chunk in an event of its own. Run it
from the root of the repository:

    OMP_NUM_THREADS=1 python benchmarks/generation.py
"""

import statistics
import time

import numpy as np
import torch
import tyro
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem

from loco_drake.control.plan import plan_from_motion
from loco_drake.generation.generate import generate_motion
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import parse_label
from loco_drake.systems.control import PlanPlayer
from loco_drake.systems.reference_generator import ReferenceGenerator
from loco_drake.systems.scenario import GeneratedReference
from loco_drake.systems.toppra_smoother import ToppraSmoother

PERIOD = 0.1  # s, of the systems' events

Times = list[tuple[float, float]]  # processor time and time on the clock, s


def planning_events(system: Diagram | LeafSystem, seconds: float) -> Times:
    """Simulates, and returns how long each event took that made more of the plan.

    The first two, which load and set up what the later ones use, do not count.
    """
    simulator = Simulator(system)
    port, context = system.GetOutputPort("plan"), simulator.get_context()
    simulator.Initialize()
    ends, times = [port.Eval(context).end_time], []
    for step in range(1, round(seconds / PERIOD) + 1):
        wall, processor = time.perf_counter(), time.process_time()
        simulator.AdvanceTo(step * PERIOD)
        times.append((time.process_time() - processor, time.perf_counter() - wall))
        ends.append(port.Eval(context).end_time)
    return [cost for cost, grown in zip(times, np.diff(ends), strict=True) if grown][2:]


def smoother_alone(robot: str, gait: str, seconds: float) -> Diagram:
    """Returns a smoother of a plan that is there already."""
    writer, model = pretrained_motion_model(robot), get_robot(robot)
    motion = generate_motion(writer, parse_label(gait), seconds, 0)
    builder = DiagramBuilder()
    player = builder.AddSystem(PlanPlayer(model, plan_from_motion(model, motion)))
    smoother = builder.AddSystem(ToppraSmoother(model))
    builder.Connect(player.GetOutputPort("plan"), smoother.GetInputPort("plan"))
    builder.ExportOutput(smoother.GetOutputPort("plan"), "plan")
    return builder.Build()


def row(name: str, times: Times) -> str:
    """Returns a row of the table: medians and maxima in ms."""
    columns = list(zip(*times, strict=True))
    cells = [f"{1000 * f(of):.1f}" for of in columns for f in (statistics.median, max)]
    return f"| {name}, {len(times)} times | {' | '.join(cells)} |"


def main(robot: str = "go2", seconds: float = 30.0, gait: str = "dog-trot") -> None:
    """Prints the table, of so many seconds of simulation."""
    torch.set_num_threads(1)
    print("| ms | processor, median | most | clock, median | most |")
    print("|---|---:|---:|---:|---:|")
    generator = ReferenceGenerator(get_robot(robot), GeneratedReference(gait=gait))
    print(row("a chunk of motion", planning_events(generator, seconds)))
    smoother = smoother_alone(robot, gait, seconds + 5)
    print(row("smoothing a chunk", planning_events(smoother, seconds)))


if __name__ == "__main__":
    tyro.cli(main)
