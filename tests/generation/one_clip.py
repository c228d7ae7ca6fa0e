"""A clip of one recording."""

from dataclasses import replace

from loco_drake.generation.training_motions import motion_clip
from tests.synthetic_motion import synthetic_motion


def clip(robot="go2", mirrored=False):
    motion = synthetic_motion(name=robot, seconds=2.0)
    origin = {"file": "one.txt", "frames": "0-100"}
    motion = replace(motion, provenance={**motion.provenance, **origin})
    return motion_clip(motion.mirrored() if mirrored else motion)
