"""How far contact solvers and steps agree: prints the tables of docs/contact.md.

The Go2 trots open loop for 4 s under every solver, step and kind of foot; where it ends
is compared with CENIC at accuracy 1e-5. Run it from the root of the repository:

    python -m benchmarks.contact_convergence [--robot a1] [--speed 0.8]
"""

import time
from collections.abc import Iterator

import numpy as np
import tyro
from numpy.typing import NDArray
from pydrake.geometry import (
    DefaultProximityProperties,
    ProximityProperties,
    RoleAssign,
    SceneGraph,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.rotations import yaw_of
from loco_drake.models.legs import LEGS
from loco_drake.models.plant import AddRobotPlant, ConfigureSimulator, PlantConfig
from loco_drake.models.robots import get_robot
from tests.models.trot import AddTrotSource

DURATION = 4.0  # s
STEPS = (1e-3, 2e-3, 5e-3, 1e-2)  # s
ACCURACIES = (1e-5, 1e-4, 1e-3, 1e-2)
FEET = (2e4, 5e4, 1e5, None)  # N/m; None is Drake's default for feet and ground


def run(
    name: str, config: PlantConfig, stiffness: float | None, speed: float
) -> tuple[NDArray[np.float64], float]:
    """Returns where the trot ends, (x in m, y in m, yaw in deg), and the speed-up."""
    robot = get_robot(name)
    builder = DiagramBuilder()
    plant, scene_graph, instance = AddRobotPlant(builder, robot, config)
    set_stiffness(plant, scene_graph, stiffness)
    AddTrotSource(builder, plant, instance, robot, duration=DURATION, speed=speed)
    simulator = Simulator(builder.Build())
    ConfigureSimulator(simulator, config)
    simulator.AdvanceTo(0.1)  # warm
    start = time.perf_counter()
    simulator.AdvanceTo(DURATION)
    wall = time.perf_counter() - start
    q = plant.GetPositions(plant.GetMyContextFromRoot(simulator.get_context()))
    final = np.array([q[4], q[5], np.degrees(yaw_of(q[:4]))])
    return final, (DURATION - 0.1) / wall


def set_stiffness(
    plant: MultibodyPlant, scene_graph: SceneGraph, stiffness: float | None
) -> None:
    """Sets the toes' stiffness; None gives toes and ground Drake's defaults."""
    bodies = [plant.GetBodyByName(f"{leg}_calf") for leg in LEGS]
    values = {"point_contact_stiffness": stiffness}
    if stiffness is None:
        bodies.append(plant.world_body())
        default = DefaultProximityProperties()
        values = {
            "point_contact_stiffness": default.point_stiffness,
            "hunt_crossley_dissipation": default.hunt_crossley_dissipation,
            "relaxation_time": default.relaxation_time,
        }
    inspector = scene_graph.model_inspector()
    for body in bodies:
        (geometry,) = plant.GetCollisionGeometriesForBody(body)
        properties = ProximityProperties(inspector.GetProximityProperties(geometry))
        for key, value in values.items():
            properties.UpdateProperty("material", key, value)
        scene_graph.AssignRole(
            plant.get_source_id(), geometry, properties, RoleAssign.kReplace
        )


def settings() -> Iterator[tuple[str, PlantConfig]]:
    """Yields every solver with each of its steps; the reference comes first."""
    for accuracy in ACCURACIES:
        config = PlantConfig(contact="cenic", accuracy=accuracy)
        yield f"CENIC, accuracy {accuracy:.0e}", config
    for contact in ("similar", "lagged", "sap"):
        for step in STEPS:
            config = PlantConfig(contact=contact, time_step=step)
            yield f"{contact}, {1e3 * step:.0f} ms", config


def main(robot: str = "go2", speed: float = 0.4) -> None:
    """Prints a table for each kind of foot; ``speed`` is that of the toes, m/s."""
    for stiffness in FEET:
        feet = "Drake's defaults" if stiffness is None else f"{stiffness:.0e} N/m"
        print(f"\nFeet: {feet}\n")
        print("| solver | x error, mm | y error, mm | yaw error, deg | x real time |")
        print("|---|---:|---:|---:|---:|")
        reference = None
        for label, config in settings():
            final, factor = run(robot, config, stiffness, speed)
            if reference is None:
                reference = final
                x, y, yaw = final
                row = f"x = {1e3 * x:.0f} | y = {1e3 * y:.0f} | yaw = {yaw:.1f}"
            else:
                x, y, yaw = final - reference
                row = f"{1e3 * x:+.0f} | {1e3 * y:+.0f} | {yaw:+.1f}"
            print(f"| {label} | {row} | {factor:.1f} |", flush=True)


if __name__ == "__main__":
    tyro.cli(main)
