"""What simulations look like in Meshcat, live or replayed."""

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat

# Enough for smooth motion; every picture more makes a saved page larger.
FRAMES_PER_SECOND = 32.0


def dress(meshcat: Meshcat) -> None:
    """Gives the scene its sky, and a camera at the start."""
    meshcat.SetProperty("/Background", "top_color", [0.75, 0.83, 0.92])
    # These would be drawn through the floor.
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetCameraPose([1.5, -2.5, 1.0], [1.0, 0.0, 0.3])


def frame(meshcat: Meshcat, p_WB: NDArray[np.float64]) -> None:
    """Puts the camera where all of the base's path, shape (N, 3), can be seen."""
    middle = (p_WB.min(axis=0) + p_WB.max(axis=0)) / 2
    along = p_WB[-1, :2] - p_WB[0, :2]
    length = float(np.hypot(*along))
    side = np.array([along[1], -along[0]]) / max(length, 1e-9)
    away = max(1.8, 0.6 * length)
    eye = [*(middle[:2] + away * side), 0.3 + 0.4 * away]
    meshcat.SetCameraPose(eye, [*middle[:2], 0.25])
