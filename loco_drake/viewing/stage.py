"""The scene graph of robots, points and a floor that move as they are told."""

from collections import Counter
from collections.abc import Sequence
from itertools import chain

import numpy as np
from pydrake.geometry import (
    GeometryInstance,
    IllustrationProperties,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    PerceptionProperties,
    QueryObject,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.arrays import Array
from loco_drake.models.ground import FLOOR_Z, TILE, floor_mesh
from loco_drake.systems.keypoint_visualizer import COLORS, NAMES, POINT
from loco_drake.viewing.captions import Legend, legend
from loco_drake.viewing.figure import AWAY, AddFigure, Figure, put_body
from loco_drake.viewing.rendering import AddRenderEngine
from loco_drake.viewing.takes import Scene

# m; the floor's pattern repeats every two tiles. It steps seldom, since a page draws
# what lies between two frames.
_FLOOR_STEP = 10 * TILE
# Share of the distance from which a video looks.
_PAGE_NEARER = 0.7


class Stage:
    """Shows scenes, the middle of which stays at the origin.

    The camera stays, and what is shown moves past it. So the viewer's own turning and
    zooming stay as they are, and a saved page follows, too, while Meshcat cannot
    animate its camera. The floor moves in steps of its pattern and never ends.

    Args:
        scenes: what will be shown.
        meshcat: where to draw it.
        rendered: whether pictures of it will be rendered.
    """

    def __init__(
        self,
        scenes: Sequence[Scene],
        meshcat: Meshcat | None = None,
        *,
        rendered: bool = False,
    ) -> None:
        self.scenes, self.meshcat = tuple(scenes), meshcat
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        self._plant = plant
        robots = {t.robot.definition: t.robot for s in self.scenes for t in s.takes}
        casts = [Counter(t.robot.definition for t in s.takes) for s in self.scenes]
        roles = [(r, k) for r in robots for k in range(max(c[r] for c in casts))]
        instances = {
            (name, k): AddFigure(plant, robots[name], f"figure{number}")
            for number, (name, k) in enumerate(roles)
        }
        radius = POINT * max(robot.foot_radius for robot in robots.values())
        sets = max(sum(t.points is not None for t in s.takes) for s in self.scenes)
        points = [_AddPoints(plant, f"points{k}", radius) for k in range(sets)]
        floor = _AddFloor(plant)
        if rendered:
            AddRenderEngine(plant, scene_graph)
        plant.Finalize()
        self._figures = {
            role: Figure(plant, robots[role[0]], instance)
            for role, instance in instances.items()
        }
        self._points = [[b.floating_positions_start() for b in s] for s in points]
        self._floor = floor.floating_positions_start()
        if meshcat is not None:
            params = MeshcatVisualizerParams(prefix="illustration")
            MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, params)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = plant.GetMyMutableContextFromRoot(self._context)
        self._query_port = scene_graph.get_query_output_port()
        self._query_context = scene_graph.GetMyContextFromRoot(self._context)

    @property
    def legend(self) -> Legend:
        """What the colours of points mean."""
        return legend(self.scenes[0].whose, points=bool(self._points))

    @property
    def query_object(self) -> QueryObject:
        """The scene graph's, as it was set up last."""
        return self._query_port.Eval(self._query_context)

    def set_up(self, scene: Scene, time: float) -> None:
        """Puts everything where it is in one of the scenes at ``time`` in s."""
        positions = np.zeros(self._plant.num_positions())
        for figure in self._figures.values():
            figure.hide(positions)
        for start in chain(*self._points):
            put_body(positions, start, AWAY)
        middle = np.append(scene.middle(time), 0.0)
        shown: Counter[str] = Counter()
        free = iter(self._points)
        for take in scene.takes:
            name, k = take.robot.definition, take.index(time)
            self._figures[name, shown[name]].put(positions, take.q[k], middle)
            shown[name] += 1
            if take.points is not None:
                for start, p in zip(next(free), take.points[k] - middle, strict=True):
                    put_body(positions, start, p)
        floor = _FLOOR_STEP * np.round(middle / _FLOOR_STEP) - middle
        floor[2] = FLOOR_Z
        put_body(positions, self._floor, floor)
        self._plant.SetPositions(self._plant_context, positions)

    def draw(self, scene: Scene, time: float, at: float = 0.0) -> None:
        """Draws a scene in Meshcat as it is at ``time``.

        Args:
            scene: one of the scenes.
            time: in the scene, s.
            at: time in Meshcat's recording, if there is one, s.
        """
        self._context.SetTime(at)
        self.set_up(scene, time)
        self._diagram.ForcedPublish(self._context)


def viewpoint(scenes: Sequence[Scene], *, page: bool = False) -> tuple[Array, Array]:
    """Returns from where to look at scenes, and at what, m, two of shape (3,).

    A ``page`` shows more around the middle than a video does, so it looks from nearer.
    """
    height = max(take.robot.stand_height for s in scenes for take in s.takes)
    width = max(scene.width for scene in scenes)
    away = height * np.array([1.6, -5.8, 2.1]) * (_PAGE_NEARER if page else 1.0)
    # More than one robot from further behind and above.
    eye = away + width * np.array([0.6, -0.5, 0.5])
    return eye, np.array([0.0, 0.0, 0.7 * height])


def _AddPoints(plant: MultibodyPlant, name: str, radius: float) -> list[RigidBody]:
    instance = plant.AddModelInstance(name)
    bodies = []
    for part, color in zip(NAMES, COLORS, strict=True):
        body = plant.AddRigidBody(part, instance)
        plant.RegisterVisualGeometry(
            body, RigidTransform(), Sphere(radius), part, color.rgba
        )
        bodies.append(body)
    return bodies


def _AddFloor(plant: MultibodyPlant) -> RigidBody:
    body = plant.AddRigidBody("floor", plant.AddModelInstance("ground"))
    floor = GeometryInstance(RigidTransform(), floor_mesh(), "floor")
    floor.set_illustration_properties(IllustrationProperties())
    floor.set_perception_properties(PerceptionProperties())
    plant.RegisterVisualGeometry(body, floor)
    return body
