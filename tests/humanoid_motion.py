"""A march of the G1, made by formula, as motion and as plans."""

import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np

from loco_drake.control.plan import make_plan, plan_from_motion
from loco_drake.datasets.human import read_human
from loco_drake.models.biped_file import read_biped
from loco_drake.models.legs import (
    MIRROR_AXIAL,
    MIRROR_LEGS,
    MIRROR_POLAR,
    MIRROR_QUATERNION,
)
from loco_drake.models.robots import get_simulated
from loco_drake.motion.motion import FPS
from loco_drake.retargeting.biped import BipedSolver, retarget_biped
from tests.synthetic_human import march, write_person


@lru_cache
def marching():
    """The motion: 1.6 s, ahead at .4 m/s."""
    robot = read_biped("g1")
    with tempfile.TemporaryDirectory() as folder:
        clip = read_human(write_person(Path(folder), march(1.6, speed=0.4)))
    return retarget_biped(clip, robot, solver=BipedSolver(robot, FPS))[0]


@lru_cache
def march_plan():
    return plan_from_motion(get_simulated("g1"), marching())


@lru_cache
def mirrored_plan():
    """The plan's mirror image, by the rule for each part of the state."""
    plan = march_plan()
    q, v = np.split(mirror_state(plan.state), [36], axis=-1)
    return make_plan(
        get_simulated("g1"),
        q=q,
        v=v,
        contacts=plan.contacts[:, MIRROR_LEGS],
        labels=plan.labels,
    )


def mirror_joints(values):
    """Left for right by the names of the joints; what rolls or yaws turns its sign."""
    names = list(get_simulated("g1").joint_names)
    others = {"left": "right", "right": "left"}
    images = [
        "_".join([others.get(n.split("_")[0], "waist"), *n.split("_")[1:]])
        for n in names
    ]
    signs = [-1.0 if "roll" in n or "yaw" in n else 1.0 for n in names]
    return values[..., [names.index(image) for image in images]] * signs


def mirror_state(state):
    parts = np.split(state, [4, 7, 36, 39, 42], axis=-1)
    return np.concatenate(
        (
            parts[0] * MIRROR_QUATERNION,
            parts[1] * MIRROR_POLAR,
            mirror_joints(parts[2]),
            parts[3] * MIRROR_AXIAL,
            parts[4] * MIRROR_POLAR,
            mirror_joints(parts[5]),
        ),
        axis=-1,
    )
