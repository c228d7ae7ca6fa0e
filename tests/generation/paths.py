"""The path that features describe, without feet that hold on to the ground."""

import numpy as np

from loco_drake.common.rotations import rotate_plane
from loco_drake.generation import features as ft


def integrate_path(robot, features, pose):
    """Returns the path of the base that features describe.

    The exact inverse of the differences in :func:`features.motion_features`.

    Args:
        robot: gives the unit of length.
        features: shape (..., T, SIZE).
        pose: x, y in m and yaw in rad of the frame before the first, shape (..., 3).

    Returns:
        x, y, yaw of the T frames, shape (..., T, 3).
    """
    turn = features[..., ft.YAW_RATE][..., 0] / ft.FPS
    yaw = pose[..., None, 2] + np.cumsum(turn, axis=-1)
    step_H = features[..., ft.VELOCITY] * robot.stand_height / ft.FPS
    steps = rotate_plane(step_H, yaw - turn / 2)
    xy = pose[..., None, :2] + np.cumsum(steps, axis=-2)
    return np.concatenate((xy, yaw[..., None]), axis=-1)
