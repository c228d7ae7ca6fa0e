"""Makes the picture of retargeting: an animal's keypoints and both robots in Meshcat.

Front toes are blue, rear toes red, withers and hip green. Needs the recordings and
Chromium on the path. From the root of the repository:

    python docs/render_retargeting.py docs/images/retargeting.png --html replay.html
"""

from pathlib import Path

import numpy as np
import tyro
from pydrake.geometry import Meshcat, MeshcatVisualizer, Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from render_picture import take_picture

from loco_drake.common.files import atomic_path
from loco_drake.datasets.registry import data_dir
from loco_drake.datasets.segments import read_segments, select_labels
from loco_drake.evaluation.replay import dress
from loco_drake.models.ground import AddGround
from loco_drake.models.robots import ROBOTS, AddRobotModel, get_robot
from loco_drake.motion.motion import FPS, Motion
from loco_drake.retargeting.retarget import retarget_clip
from loco_drake.retargeting.scaling import resample
from loco_drake.systems.keypoint_visualizer import COLORS, NAMES

RADIUS = 0.02  # of the animal's keypoints, m


def main(
    png: tyro.conf.Positional[Path],
    label: str = "dog-trot",
    stretch: int = 1,
    time: float = 2.02,
    seconds: float = 2.5,
    gap: float = 0.6,
    html: Path | None = None,
    data: Path | None = None,
    size: tuple[int, int] = (1280, 560),
) -> None:
    """Retargets one stretch to both robots, and draws all three side by side.

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
    motions = [retarget_clip(clip, get_robot(name))[0] for name in ROBOTS]
    resampled = resample(clip, FPS)
    points = np.concatenate(
        (resampled.toes, resampled.withers[:, None], resampled.hip[:, None]), axis=1
    )
    # All are at x = 0 at the time of the picture.
    frame = round(time * FPS)
    points[..., 0] -= points[frame, 4:, 0].mean()
    scene = Scene(points, motions, frame, gap)
    meshcat = scene.meshcat
    scene.draw(frame)
    toes, withers, hip = points[frame, :4], points[frame, 4], points[frame, 5]
    ends = np.array([hip, withers, withers, hip, hip]), np.array([withers, *toes])
    meshcat.SetLineSegments("lines", ends[0].T, ends[1].T, 3.0, Rgba(0.2, 0.2, 0.2))
    meshcat.SetCameraPose([2.0, 1.0 - gap, 0.9], [0.0, 0.04 - gap, 0.19])
    # Meshcat's camera sees 75 degrees: a longer lens, from further away.
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "zoom", 2.6)
    take_picture(meshcat.StaticHtml(), png, size)
    meshcat.Delete("lines")
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "zoom", 1.0)
    if html is not None:
        # The seconds around the picture, so that all pass by the camera; every other
        # frame, since the page is nearly full of meshes.
        first = max(0, frame - round(seconds * FPS / 2))
        last = min(len(points), first + round(seconds * FPS))
        meshcat.SetCameraPose([0.0, 2.2, 1.1], [0.0, 0.0, 0.2])
        meshcat.StartRecording(frames_per_second=FPS / 2)
        for k in range(first, last, 2):
            scene.draw(k, (k - first) / FPS)
        meshcat.PublishRecording()
        page = meshcat.StaticHtml()
        with atomic_path(html) as temporary:
            temporary.write_text(page)
        print(f"{html}: {len(page) / 1e6:.1f} MB, {(last - first) / FPS:.1f} s")


class Scene:
    """Keypoints and robots in one Meshcat.

    Args:
        points: toes, withers and hip of the animal in m, shape (T, 6, 3).
        motions: of the robots, drawn to the animal's right.
        frame: at which the robots are at x = 0.
        gap: from one to the next, m.
    """

    def __init__(
        self, points: np.ndarray, motions: list[Motion], frame: int, gap: float
    ) -> None:
        self.meshcat = Meshcat()
        dress(self.meshcat)
        self._points = points
        for name, color in zip(NAMES, COLORS, strict=True):
            self.meshcat.SetObject(f"animal/{name}", Sphere(RADIUS), color)
        builder = DiagramBuilder()
        self._plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        self._robots = []
        for index, motion in enumerate(motions):
            instance = AddRobotModel(Parser(self._plant), motion.robot, visual=True)
            shift = np.array([-motion.base_position[frame, 0], -(index + 1) * gap, 0.0])
            self._robots.append((instance, motion, shift))
        AddGround(self._plant, friction=1.0, visual=True)
        self._plant.Finalize()
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, self.meshcat)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def draw(self, k: int, time: float = 0.0) -> None:
        """Publishes frame ``k`` as that of ``time`` in s."""
        self._context.SetTime(time)
        plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        for instance, motion, shift in self._robots:
            q = (
                motion.base_quaternion[k],
                motion.base_position[k] + shift,
                motion.joint_positions[k],
            )
            self._plant.SetPositions(plant_context, instance, np.concatenate(q))
        for name, p_W in zip(NAMES, self._points[k], strict=True):
            self.meshcat.SetTransform(f"animal/{name}", RigidTransform(p_W), time)
        self._diagram.ForcedPublish(self._context)


if __name__ == "__main__":
    tyro.cli(main)
