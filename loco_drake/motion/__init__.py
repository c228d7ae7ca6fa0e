"""Motion of animals and robots: keypoints, gaits, rhythm, files and their quality."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from loco_drake.motion.motion import FPS as FPS
    from loco_drake.motion.motion import Motion as Motion
    from loco_drake.motion.motion import make_motion as make_motion
    from loco_drake.motion.motion_file import load_motion as load_motion
    from loco_drake.motion.motion_file import save_motion as save_motion

# Imported when first used: reading a Motion file needs the robots and so Drake.
_FROM = {
    "FPS": "motion",
    "Motion": "motion",
    "load_motion": "motion_file",
    "make_motion": "motion",
    "save_motion": "motion_file",
}
__all__ = list(_FROM)


def __getattr__(name: str) -> Any:
    if name not in _FROM:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_FROM[name]}"), name)
