"""Ground whose shape is in the Context: planes of its own for each toe, and a step.

Drake's contact of points takes no surface with hollows, but for a small sphere a smooth
surface is its tangent plane. Each toe therefore touches a plane of its own, which is
moved to where the toe is, and all else of the robot another one. They and the step are
boxes of bodies welded to frames whose poses are parameters. Drake 1.51 ignores new
poses of shapes that are anchored to the world, and its search for contacts crashes if
there are several half spaces.
"""

import numpy as np
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RigidBody,
    SpatialInertia,
    world_model_instance,
)
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array

from .legs import LEGS

_INSTANCE = "movable_ground"  # and prefix of its bodies and frames
_STEP, _PLANE = "step", "plane"
_STEP_SIZE = np.array([20.0, 40.0, 1.0])  # m
_PLANE_SIZE = np.array([400.0, 400.0, 2.0])  # m
_AWAY = 100.0  # m below the ground


def AddMovableGround(
    plant: MultibodyPlant, properties: ProximityProperties
) -> RigidBody:
    """Adds level ground to a plant that is not finalized; returns its body.

    It needs :func:`FilterMovableGround` when all other shapes have been added.
    """
    instance = plant.AddModelInstance(_INSTANCE)

    def add(name: str, size: Array, z: float = 0.0) -> RigidBody:
        full = f"{_INSTANCE}_{name}"
        body = plant.AddRigidBody(full, instance, SpatialInertia.Zero())
        X_WG = RigidTransform([0.0, 0.0, z])
        frame = FixedOffsetFrame(full, plant.world_frame(), X_WG)
        plant.WeldFrames(plant.AddFrame(frame), body.body_frame())
        # The frame is in the middle of the top.
        X_BG = RigidTransform([0.0, 0.0, -size[2] / 2])
        plant.RegisterCollisionGeometry(body, X_BG, Box(*size), "ground", properties)
        return body

    for leg in LEGS:
        add(leg, _PLANE_SIZE)
    add(_STEP, _STEP_SIZE, -_AWAY)
    return add(_PLANE, _PLANE_SIZE)


def FilterMovableGround(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    """Lets each toe touch its own plane only, and all else only the main plane."""
    inspector = scene_graph.model_inspector()
    shapes = inspector.GetAllGeometryIds(Role.kProximity)
    manager = scene_graph.collision_filter_manager()

    def exclude(ground: GeometryId, others: list[GeometryId]) -> None:
        declaration = CollisionFilterDeclaration()
        declaration.ExcludeBetween(GeometrySet(ground), GeometrySet(others))
        manager.Apply(declaration)

    toes = {
        leg: shape
        for shape in shapes
        for leg in LEGS
        if inspector.GetName(shape).split("::")[-1] == f"{leg}_toe"
    }
    exclude(_shape(plant, _PLANE), list(toes.values()))
    for leg, toe in toes.items():
        own = _shape(plant, leg)
        exclude(own, [shape for shape in shapes if shape not in (toe, own)])


def HasMovableGround(plant: MultibodyPlant) -> bool:
    """Returns whether the plant's ground is movable."""
    return bool(plant.HasModelInstanceNamed(_INSTANCE))


def ground_shapes(plant: MultibodyPlant) -> list[GeometryId]:
    """Returns all shapes of movable ground."""
    return [_shape(plant, name) for name in (*LEGS, _STEP, _PLANE)]


def TiltGround(plant: MultibodyPlant, context: Context, gradient: Array) -> None:
    """Inclines all planes about the world's origin, in the plant's Context.

    ``gradient`` is the rise of the ground per metre along x and y, shape (2,).
    """
    for name in (*LEGS, _PLANE):
        _move(plant, context, name, _plane(np.zeros(3), gradient))


def PlaceStep(plant: MultibodyPlant, context: Context, height: float, x: float) -> None:
    """Puts a step up of ``height``, m, across the x axis at ``x``; if 0, nowhere."""
    z = height if height > 0 else -_AWAY
    _move(plant, context, _STEP, RigidTransform([x + _STEP_SIZE[0] / 2, 0.0, z]))


def PlaceToePlanes(
    plant: MultibodyPlant, context: Context, points: Array, gradients: Array
) -> None:
    """Moves the toes' planes, in the plant's Context.

    Args:
        plant: the plant, finalized.
        context: its Context.
        points: a point of each plane, m, shape (4, 3).
        gradients: rise of each per metre along x and y, shape (4, 2).
    """
    for leg, point, gradient in zip(LEGS, points, gradients, strict=True):
        _move(plant, context, leg, _plane(point, gradient))


def _plane(point: Array, gradient: Array) -> RigidTransform:
    normal = np.array([-gradient[0], -gradient[1], 1.0])
    R_WG = RotationMatrix.MakeFromOneVector(normal, axis_index=2)
    return RigidTransform(R_WG, point)


def _move(
    plant: MultibodyPlant, context: Context, name: str, X_WG: RigidTransform
) -> None:
    frame = plant.GetFrameByName(f"{_INSTANCE}_{name}", world_model_instance())
    frame.SetPoseInParentFrame(context, X_WG)


def _shape(plant: MultibodyPlant, name: str) -> GeometryId:
    body = plant.GetBodyByName(f"{_INSTANCE}_{name}")
    (shape,) = plant.GetCollisionGeometriesForBody(body)
    return shape
