"""Writes a Motion file of one's own: a robot that bows over feet that stand."""

from pathlib import Path

import numpy as np
import tyro

import loco_drake as ld
from loco_drake.motion import FPS, make_motion
from loco_drake.motion.gaits import GaitLabel
from loco_drake.retargeting.inverse_kinematics import LegSolver


def write(
    out: Path = Path("bow.npz"), seconds: float = 4.0, depth: float = 0.04
) -> None:
    """Lowers the trunk by ``depth`` in m and raises it, every two seconds."""
    robot = ld.get_robot("go2")
    time = np.arange(round(seconds * FPS)) / FPS
    p_WB = np.zeros((len(time), 3))
    p_WB[:, 2] = robot.stand_height - depth * (1 - np.cos(np.pi * time)) / 2
    # Toes in the frame of the trunk: as far below as the trunk is high.
    p_BF = robot.toe_positions(robot.stand_joints) - (p_WB - p_WB[0])[:, None]
    joints, solved = LegSolver(robot, FPS).solve(p_BF)
    motion = make_motion(
        robot=robot.name,
        label=GaitLabel("own", "bow"),
        joint_names=robot.joint_names,
        base_position=p_WB,
        base_quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1)),
        joint_positions=joints,
        contacts=np.ones((len(time), 4), dtype=bool),
        provenance={"made": "by examples/own_motion.py"},
    )
    ld.save_motion(motion, out)
    print(f"{out}: {len(motion)} frames, {solved.sum()} of them solved")


if __name__ == "__main__":
    tyro.cli(write)
