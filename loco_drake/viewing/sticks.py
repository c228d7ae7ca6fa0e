"""Colours and places of the shapes of robots that are known by a file alone."""

from pydrake.geometry import Rgba
from pydrake.math import RigidTransform, RotationMatrix

from loco_drake.common.arrays import Array

TRUNK = Rgba(0.3, 0.32, 0.36)
LEFT = Rgba(0.85, 0.6, 0.25)
RIGHT = Rgba(0.4, 0.55, 0.75)
FOOT = Rgba(0.1, 0.1, 0.1)


def along(start: Array, end: Array) -> RigidTransform:
    """Returns the frame midway between two points, z along the line between them."""
    way = end - start
    if way @ way == 0:
        return RigidTransform(start)
    return RigidTransform(RotationMatrix.MakeFromOneVector(way, 2), (start + end) / 2)
