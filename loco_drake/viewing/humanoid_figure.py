"""A humanoid that is shown: capsules from joint to joint, a chest, a head and soles."""

import numpy as np
from pydrake.geometry import Box, Capsule, Ellipsoid, Rgba, Shape, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody

from loco_drake.common.arrays import Array
from loco_drake.models.biped import Biped
from loco_drake.viewing.sticks import FOOT, LEFT, RIGHT, TRUNK, along

# Over the height of the pelvis in the stance.
_LEG, _ARM, _HEAD = 0.055, 0.04, 0.11
_PELVIS = np.array([0.16, 0.26, 0.14])
_SHORT = 0.02  # shorter bones are not drawn
_SOLE = 0.025  # m, of its thickness
_COLORS = {"left": LEFT, "right": RIGHT, "middle": TRUNK}
# A hand is beyond the wrist, by this of the forearm.
_HAND = 0.6


def AddBody(plant: MultibodyPlant, robot: Biped, instance: ModelInstanceIndex) -> None:
    """Adds what can be seen of a humanoid to its model in a plant.

    The plant is not finalized; left limbs have another colour than right ones.
    """
    size = robot.stand_height
    trunk = plant.GetBodyByName(robot.trunk_frame, instance)
    chest = plant.GetBodyByName(robot.chest_frame, instance)
    shapes = _Shapes(plant)
    hips = robot.p_BHip.mean(axis=0)
    shapes.add(trunk, RigidTransform(hips * 0.6), Box(*(_PELVIS * size)), TRUNK)
    _AddLimbs(plant, robot, instance, shapes)
    left, right = robot.p_CShoulder
    middle = (left + right) / 2
    # From the waist to the shoulders, nearly as wide as these.
    radii = np.array([0.11 * size, np.linalg.norm(left - right) / 2, 0.62 * middle[2]])
    shapes.add(chest, RigidTransform(0.55 * middle), Ellipsoid(*radii), TRUNK)
    head = middle + np.array([0.0, 0.0, 1.9 * _HEAD * size])
    shapes.add(chest, RigidTransform(head), Sphere(_HEAD * size), TRUNK)
    length, width = robot.sole_length, 2 * robot.sole_half_width
    flat = Box(length + width / 2, 1.3 * width, _SOLE)
    lift = np.array([0.0, 0.0, _SOLE / 2 - robot.foot_radius])
    for frame in robot.foot_frames:
        foot = plant.GetBodyByName(frame, instance)
        shapes.add(foot, RigidTransform(robot.sole_middle + lift), flat, FOOT)


class _Shapes:
    """Numbers the visual geometries of a plant."""

    def __init__(self, plant: MultibodyPlant) -> None:
        self._plant, self._count = plant, 0

    def add(
        self, body: RigidBody, X_LG: RigidTransform, shape: Shape, color: Rgba
    ) -> None:
        name = f"shape{self._count}"
        self._plant.RegisterVisualGeometry(body, X_LG, shape, name, color.rgba)
        self._count += 1


def _AddLimbs(
    plant: MultibodyPlant,
    robot: Biped,
    instance: ModelInstanceIndex,
    shapes: _Shapes,
) -> None:
    """Adds a capsule along each bone: from a joint's frame to the next joint's."""
    size = robot.stand_height
    for place, name in enumerate(robot.joint_names):
        joint = plant.GetJointByName(name, instance)
        parent = joint.parent_body()
        if parent.name() in (robot.trunk_frame, robot.chest_frame):
            continue
        radius = (_LEG if place < robot.leg_joints else _ARM) * size
        end = joint.frame_on_parent().GetFixedPoseInBodyFrame().translation()
        color = _COLORS[robot.side(place)]
        _AddBone(shapes, parent, np.zeros(3), end, radius, color)
    for side, (_, wrist) in enumerate(robot.arm_frames):
        body = plant.GetBodyByName(wrist, instance)
        reach = _HAND * robot.arm_lengths[side, 1]
        end = np.array([reach, 0.0, 0.0])
        color = _COLORS["right" if side else "left"]
        _AddBone(shapes, body, np.zeros(3), end, _ARM * size, color)


def _AddBone(
    shapes: _Shapes, body: RigidBody, start: Array, end: Array, radius: float, c: Rgba
) -> None:
    length = float(np.linalg.norm(end - start))
    if length > _SHORT:
        shapes.add(body, along(start, end), Capsule(radius, length), c)
