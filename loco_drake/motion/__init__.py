"""Motion of animals and robots: keypoints, gaits, rhythm, files and their quality."""

from loco_drake.motion.motion import FPS, Motion, make_motion
from loco_drake.motion.motion_file import load_motion, save_motion
from loco_drake.motion.motion_folder import open_motions

__all__ = ["FPS", "Motion", "load_motion", "make_motion", "open_motions", "save_motion"]
