"""What surrounds a robot on Meshcat's page: sky, sun and camera."""

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from loco_drake.common.arrays import Array

# From where a robot at the origin is seen, and what is in the middle then, m. So near
# that it fills a tenth of a page that is twice as wide as high.
EYE, TARGET = (0.35, -1.25, 0.55), (0.0, 0.0, 0.2)

_SUN = "/Lights/FillLight/<object>"
# From behind the left shoulder of who looks from EYE, m.
_SUN_PLACE = [-1.75, -3.0, 6.0]
# Shadows are drawn that far around the origin, m, with so many pixels along a side; for
# a longer way with more, up to the most that every browser has.
_SHADOW_REACH, _SHADOW_PIXELS, _MOST_PIXELS = 3.0, 1024, 4096
_AROUND = 1.0  # that the robot and its shadow take around the base, m
# Times that a replay is repeated.
_AGAIN = 100_000


def dress(meshcat: Meshcat) -> None:
    """Sets sky, sun, shadows and the initial camera of the page.

    They stay where they are, so they follow a robot that stays at the origin.
    """
    meshcat.SetProperty("/Background", "top_color", [0.75, 0.83, 0.92])
    # These would be drawn through the floor.
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    # Lamps, which would light a few metres of the floor.
    meshcat.SetProperty("/Lights/PointLightNegativeX", "visible", False)
    meshcat.SetProperty("/Lights/PointLightPositiveX", "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.2)
    meshcat.SetProperty(_SUN, "position", _SUN_PLACE)
    meshcat.SetProperty(_SUN, "intensity", 2.2)
    _cast_shadows(meshcat, _SHADOW_REACH)
    # Otherwise surfaces would have stripes of their own shadow.
    meshcat.SetProperty(_SUN, "shadow.bias", -0.001)
    meshcat.SetProperty(_SUN, "castShadow", True)
    meshcat.SetCameraPose(EYE, TARGET)


def publish_replay(meshcat: Meshcat) -> None:
    """Ends the recording and shows it on the page, over and over."""
    meshcat.StopRecording()
    recording = meshcat.get_mutable_recording()
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    recording.set_repetitions(_AGAIN)
    meshcat.PublishRecording()


def frame(meshcat: Meshcat, p_WB: Array) -> None:
    """Moves the camera to show all of the base's path, shape (N, 3), with shadows."""
    reach = float(np.linalg.norm(p_WB[:, :2], axis=1).max()) + _AROUND
    _cast_shadows(meshcat, max(reach, _SHADOW_REACH))
    middle = (p_WB.min(axis=0) + p_WB.max(axis=0)) / 2
    along = p_WB[-1, :2] - p_WB[0, :2]
    length = float(np.hypot(*along))
    side = np.array([along[1], -along[0]]) / max(length, 1e-9)
    away = max(1.8, 0.6 * length)
    eye = [*(middle[:2] + away * side), 0.3 + 0.4 * away]
    meshcat.SetCameraPose(eye, [*middle[:2], 0.25])


def _cast_shadows(meshcat: Meshcat, reach: float) -> None:
    """Lets the sun cast shadows up to ``reach`` in m from the origin."""
    for side, sign in (("left", -1), ("right", 1), ("bottom", -1), ("top", 1)):
        meshcat.SetProperty(_SUN, f"shadow.camera.{side}", sign * reach)
    meshcat.SetProperty(_SUN, "shadow.camera.near", -reach)
    meshcat.SetProperty(_SUN, "shadow.camera.far", 20.0 + reach)
    pixels = _SHADOW_PIXELS
    while pixels < _MOST_PIXELS and pixels * _SHADOW_REACH < _SHADOW_PIXELS * reach:
        pixels *= 2
    for side in ("width", "height"):
        meshcat.SetProperty(_SUN, f"shadow.mapSize.{side}", float(pixels))
