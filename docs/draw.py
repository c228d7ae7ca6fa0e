r"""Draws pictures of the documentation, with the shipped weights.

From the root of the repository. The first two need Chromium on the path (``chromium``,
headless), `retargeting` the recordings, too:

    python docs/draw.py robot docs/images/go2_trot.png
    python docs/draw.py retargeting docs/images/retargeting.png --html replay.html
    python docs/draw.py gait-change docs/images/gait_change.png
    python docs/draw.py paper
    python docs/draw.py steering
    python docs/draw.py gait-choice docs/images/gait_choice.png
    python docs/draw.py robustness docs/images/robustness.png
    python docs/draw.py humanoid docs/images/humanoid.png \
        --motions motions/g1/human-walk.npz motions/g1/human-run.npz

``loco-drake evaluate ... --figures`` draws the others, among them Figure 1 of the
paper, models/pretrained/results/retargeted-dog-pace.webp. The README's moving picture:

    loco-drake simulate --no-meshcat --gait dog-pace,dog-trot@1.8 \
        --duration 3.8 --seed 1 --video docs/images/go2.webp
"""

import subprocess
import tempfile
from pathlib import Path

import numpy as np
import tyro
from pydrake.geometry import Meshcat, MeshcatVisualizer, Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from loco_drake.cli.output import write_figure
from loco_drake.common.files import atomic_path, read_json
from loco_drake.datasets.registry import data_dir
from loco_drake.datasets.segments import read_segments, select_labels
from loco_drake.evaluation.dataset_picture import library_figure
from loco_drake.evaluation.gait_change import change_figure
from loco_drake.evaluation.gait_choice_picture import choice_figure
from loco_drake.evaluation.humanoid import humanoid_track
from loco_drake.evaluation.library import read_library
from loco_drake.evaluation.report.results import load_results, results_dir
from loco_drake.evaluation.robustness_pictures import curves_figure
from loco_drake.evaluation.steering_pictures import grid_figure, steering_figures
from loco_drake.evaluation.tracking import Recorder
from loco_drake.evaluation.tracking_pictures import (
    learning_figure,
    record_traces,
    returns_figure,
    traces_figure,
)
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.biped_file import read_biped
from loco_drake.models.ground import AddGround
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import ROBOTS, AddRobotModel, get_robot
from loco_drake.models.scenery import dress
from loco_drake.models.shipped import results_path
from loco_drake.motion.gait_timing import gait_timing
from loco_drake.motion.gaits import parse_schedule
from loco_drake.motion.momentum import positions
from loco_drake.motion.motion import FPS
from loco_drake.motion.motion_file import load_motion
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import resample
from loco_drake.systems.gait_selector import measured_gaits
from loco_drake.systems.keypoint_visualizer import COLORS, NAMES
from loco_drake.systems.scenario import (
    GeneratedReference,
    Scenario,
    SteeringConfig,
    TrainedPolicy,
)
from loco_drake.viewing.poses import row_of, rows_figure
from loco_drake.viewing.source_clip import source_clip

Png = tyro.conf.Positional[Path]

_CHROMIUM = (
    "chromium --headless=new --no-sandbox --disable-dev-shm-usage --hide-scrollbars "
    "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--disable-background-networking --no-first-run --virtual-time-budget=20000"
)
_RADIUS = 0.02  # of the animal's keypoints, m
_ZOOM = ("/Cameras/default/rotated/<object>", "zoom")


def robot(
    png: Png,
    gait: str = "dog-trot",
    seed: int = 3,
    time: float = 3.1,
    policy: Path | None = None,
    size: tuple[int, int] = (1280, 640),
) -> None:
    """The Go2 in the middle of a gait, ``time`` s after its start, and its plan."""
    meshcat = Meshcat()
    dress(meshcat)
    scenario = Scenario(
        plant=PlantConfig(visual=True),
        reference=GeneratedReference(gait=gait, seed=seed),
        policy=TrainedPolicy(weights=policy),
    )
    recorder = Recorder(scenario, meshcat, follow=True)
    recorder.start()
    recorder.run(time)
    recorder.diagram.ForcedPublish(recorder.context)
    meshcat.SetCameraPose([0.75, -0.95, 0.5], [0.02, 0.0, 0.2])
    take_picture(meshcat, png, size)


def retargeting(
    png: Png,
    label: str = "dog-trot",
    stretch: int = 1,
    time: float = 2.02,
    seconds: float = 2.5,
    gap: float = 0.6,
    html: Path | None = None,
    data: Path | None = None,
    size: tuple[int, int] = (1280, 560),
) -> None:
    """An animal's keypoints and both robots that do the same, side by side.

    Front toes are blue, rear toes red, withers and hip green.

    Args:
        png: the picture.
        label: such as dog-trot.
        stretch: which of the label's stretches, from 0.
        time: of the picture, s.
        seconds: of the replay.
        gap: between the animal and the robots, m.
        html: where to save the replay.
        data: folder of the recordings.
        size: of the picture, pixels.
    """
    segment = select_labels(read_segments(data_dir(data)), [label])[stretch]
    clip = segment.read()
    moved = resample(clip, FPS)
    trunk = moved.withers[:, None], moved.hip[:, None]
    points = np.concatenate((moved.toes, *trunk), axis=1)
    # All are at x = 0 at the time of the picture.
    frame = round(time * FPS)
    points[..., 0] -= points[frame, 4:, 0].mean()
    meshcat = Meshcat()
    dress(meshcat)
    for name, color in zip(NAMES, COLORS, strict=True):
        meshcat.SetObject(f"animal/{name}", Sphere(_RADIUS), color)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    positions = []
    for place, name in enumerate(ROBOTS, start=1):
        instance = AddRobotModel(Parser(plant), name, visual=True)
        motion, _ = retarget_clip(clip, get_robot(name))
        shift = [-motion.base_position[frame, 0], -place * gap, 0.0]
        q = (motion.base_quaternion, motion.base_position + shift)
        positions.append((instance, np.hstack((*q, motion.joint_positions))))
    AddGround(plant, friction=1.0, visual=True)
    plant.Finalize()
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()

    def draw(k: int, time: float = 0.0) -> None:
        context.SetTime(time)
        for instance, q in positions:
            own = plant.GetMyMutableContextFromRoot(context)
            plant.SetPositions(own, instance, q[k])
        for name, p_W in zip(NAMES, points[k], strict=True):
            meshcat.SetTransform(f"animal/{name}", RigidTransform(p_W), time)
        diagram.ForcedPublish(context)

    draw(frame)
    toes, withers, hip = points[frame, :4], points[frame, 4], points[frame, 5]
    ends = np.array([hip, withers, withers, hip, hip]), np.array([withers, *toes])
    meshcat.SetLineSegments("lines", ends[0].T, ends[1].T, 3.0, Rgba(0.2, 0.2, 0.2))
    meshcat.SetCameraPose([2.0, 1.0 - gap, 0.9], [0.0, 0.04 - gap, 0.19])
    # Meshcat's camera sees 75 degrees: a longer lens, from further away.
    meshcat.SetProperty(*_ZOOM, 2.6)
    take_picture(meshcat, png, size)
    if html is None:
        return
    # The seconds around the picture, so that all pass by the camera; every other
    # frame, since the page is nearly full of meshes.
    meshcat.Delete("lines")
    meshcat.SetProperty(*_ZOOM, 1.0)
    first = max(0, frame - round(seconds * FPS / 2))
    last = min(len(points), first + round(seconds * FPS))
    meshcat.SetCameraPose([0.0, 2.2, 1.1], [0.0, 0.0, 0.2])
    meshcat.StartRecording(frames_per_second=FPS / 2)
    for k in range(first, last, 2):
        draw(k, (k - first) / FPS)
    meshcat.PublishRecording()
    with atomic_path(html) as temporary:
        temporary.write_text(meshcat.StaticHtml())
    print(f"{html}: {html.stat().st_size / 1e6:.1f} MB, {(last - first) / FPS:.1f} s")


def gait_change(
    png: Png,
    gait: str = "dog-pace,dog-trot@3,dog-gallop@6",
    duration: float = 9.0,
    seed: int = 0,
    robot: str = "go2",
) -> None:
    """A motion that changes its gait twice: its feet and its speed."""
    model, schedule = pretrained_motion_model(robot), parse_schedule(gait)
    (motion,) = generate_motions(model, schedule, duration, [seed])
    write_figure(change_figure(model.robot, motion, schedule), png, dpi=80)


def paper(folder: Path = Path("docs/images"), seed: int = 0) -> None:
    """Figures 2 and 3 of the paper, as ``loco-drake report`` draws them.

    Args:
        folder: of the pictures.
        seed: of the motion that is tracked.
    """
    results = load_results(results_dir())
    library = read_library(results.of_robots("retargeting")["go2"])
    pictures = {
        "figure_2": library_figure(library),
        "figure_3_returns": returns_figure(results.of_robots("tracking-generated")),
        "figure_3_motion": traces_figure(record_traces(ROBOTS, seed)),
        "figure_3_learning": learning_figure(results.of_robots("learning"))[0],
    }
    for name, picture in pictures.items():
        write_figure(picture, folder / f"{name}.png", dpi=80)


def steering(
    folder: Path = Path("docs/images"),
    robot: str = "go2",
    gait: str = "mpc-trot",
    seed: int = 0,
    results: Path | None = None,
) -> None:
    """A robot that follows commands: errors over the grid, a drive, a figure of eight.

    Args:
        folder: of the pictures.
        robot: go2 or a1.
        gait: of the drive and of the figure of eight.
        seed: of the drive.
        results: of ``loco-drake evaluate steering``; the shipped ones by default.
    """
    found = read_json(results or results_path(f"steering-{robot}"))
    scenario = Scenario(
        robot=robot,
        reference=GeneratedReference(gait=gait, duration=60.0),
        steering=SteeringConfig(measured_ranges=False),
        policy=TrainedPolicy(),
    )
    chosen = {**found, "labels": {gait: found["labels"][gait]}}
    pictures = dict(steering_figures(scenario, chosen, seed))
    pictures["grid"] = grid_figure(robot, found)
    for title, picture in pictures.items():
        name = f"steering_{robot}_{title.removeprefix(f'{gait}-')}.png"
        write_figure(picture, folder / name, dpi=80)


def robustness(png: Png) -> None:
    """What both robots survive."""
    found = load_results(results_dir()).of_robots("robustness")
    write_figure(curves_figure(found), png, dpi=80)


def humanoid(png: Png, motions: tuple[Path, ...], data: Path | None = None) -> None:
    """Motion of the G1 that ``loco-drake humanoid`` wrote, and the people in its size.

    Args:
        png: the picture.
        motions: Motion files, a row for each.
        data: folder of the recordings.
    """
    g1 = read_biped("g1")
    rows, names = [], []
    for path in motions:
        motion = load_motion(path)
        clip = resample(source_clip(motion, data_dir(data)), FPS)
        ends = clip.withers[:, None], clip.hip[:, None]
        points = np.concatenate((clip.toes, *ends), axis=1)
        timing = gait_timing(humanoid_track(motion, g1))
        stride = timing.stride_period if timing else motion.duration
        rows.append(row_of(g1, positions(motion), points, stride))
        names.append(motion.gait)
    kinds = ("toes", "heels", "neck and pelvis")
    write_figure(rows_figure(rows, names, kinds), png, dpi=100)


def gait_choice(png: Png) -> None:
    """The gait that a command chooses, by what ``evaluate steering`` measured."""
    gaits = {name: measured_gaits(get_robot(name)) for name in ROBOTS}
    write_figure(choice_figure(gaits), png, dpi=80)


def take_picture(meshcat: Meshcat, png: Path, size: tuple[int, int]) -> None:
    """Writes a picture of what Meshcat shows, ``size`` pixels wide and high."""
    png.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text(meshcat.StaticHtml())
        options = (
            f"--user-data-dir={folder}/profile",
            f"--window-size={size[0]},{size[1]}",
            f"--screenshot={png.resolve()}",
        )
        command = [*_CHROMIUM.split(), *options, page.as_uri()]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)


if __name__ == "__main__":
    pictures = {
        "robot": robot,
        "retargeting": retargeting,
        "gait-change": gait_change,
        "paper": paper,
        "steering": steering,
        "gait-choice": gait_choice,
        "robustness": robustness,
        "humanoid": humanoid,
    }
    tyro.extras.subcommand_cli_from_dict(pictures)
