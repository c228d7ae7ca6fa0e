"""Retarget one recording to a robot and look at it, without physics.

Prints how far the toes had to be moved from where the formula puts them so that they
stand still. Then plays the motion in Meshcat, at the address that is printed: the robot
as it should move, with spheres at its toes (front blue, rear red), withers and hip
(green). With --html the replay is saved instead, as a page to be opened in a browser.
"""

from pathlib import Path
from typing import Annotated

import tyro
from pydrake.geometry import Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from loco_drake.common.files import atomic_path
from loco_drake.control.plan import Plan, plan_from_motion
from loco_drake.datasets.registry import read_clip
from loco_drake.models.robots import AddRobotModel, Robot, get_robot
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.systems.control import PlanPlayer, PlanState
from loco_drake.systems.keypoint_visualizer import KeypointVisualizer


def retarget(
    recording: Annotated[Path, tyro.conf.Positional],
    source: str = "dog",
    gait: str = "trot",
    start: int = 0,
    end: int | None = None,
    robot: str = "go2",
    html: Path | None = None,
) -> None:
    """Retargets a recording and shows it.

    Args:
        recording: the file.
        source: whose format it has.
        gait: what the animal does in it.
        start: first frame, from 0.
        end: frame after the last; by default the end of the file.
        robot: go2 or a1.
        html: where to save the replay, instead of playing it in real time.
    """
    clip = read_clip(source, recording, gait=gait, start=start, end=end)
    model = get_robot(robot)
    motion, report = retarget_clip(clip, model)
    moved, slip = 1000 * report.correction_rmse_m, report.stance_slip_median_mps
    print(f"{len(motion)} frames; toes moved by {moved:.0f} mm, slip {slip:.3f} m/s")
    for warning in report.warnings:
        print(f"Warning: {warning}")
    meshcat = Meshcat()
    plan = plan_from_motion(model, motion)
    simulator = Simulator(make_playback(model, plan, meshcat))
    if html is None:
        simulator.set_target_realtime_rate(1.0)
    meshcat.StartRecording(frames_per_second=32.0)
    simulator.AdvanceTo(plan.end_time)
    meshcat.PublishRecording()
    if html is not None:
        with atomic_path(html) as temporary:
            temporary.write_text(meshcat.StaticHtml())
        print(f"The replay is in {html}.")


def make_playback(robot: Robot, plan: Plan, meshcat: Meshcat) -> Diagram:
    """Returns a diagram that moves the robot's picture along ``plan``."""
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    plant = MultibodyPlant(time_step=0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    AddRobotModel(Parser(plant), robot.name, visual=True)
    plant.Finalize()

    player = builder.AddSystem(PlanPlayer(robot, plan))
    state = builder.AddSystem(PlanState(robot))
    poses = builder.AddSystem(
        MultibodyPositionToGeometryPose(plant, input_multibody_state=True)
    )
    spheres = builder.AddSystem(KeypointVisualizer(robot, meshcat))
    builder.Connect(player.GetOutputPort("plan"), state.GetInputPort("plan"))
    builder.Connect(player.GetOutputPort("plan"), spheres.GetInputPort("plan"))
    builder.Connect(state.GetOutputPort("state"), poses.get_input_port())
    builder.Connect(
        poses.get_output_port(),
        scene_graph.get_source_pose_port(plant.get_source_id()),
    )
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    return builder.Build()


if __name__ == "__main__":
    tyro.cli(retarget)
