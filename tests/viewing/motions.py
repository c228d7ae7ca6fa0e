"""Motion of robots that are known by a file alone."""

import numpy as np

from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion import make_motion


def swinging(robot, frames=25):
    """Returns a motion on the spot that swings all joints about the stance."""
    swing = 0.1 * np.sin(0.4 * np.arange(frames))[:, None]
    return make_motion(
        robot=robot.name,
        label=GaitLabel("made", "swing"),
        joint_names=robot.joint_names,
        base_position=np.tile([0.0, 0.0, robot.stand_height], (frames, 1)),
        base_quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1)),
        joint_positions=robot.stand_joints + swing,
        contacts=np.ones((frames, 4), dtype=bool),
        provenance={},
    )
