"""Writes a plan as arrays that NumPy reads, for use without Drake and this package."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake import __version__
from loco_drake.common.files import atomic_path
from loco_drake.control.action import set_points
from loco_drake.control.feed_forward import feed_forward_torques
from loco_drake.control.observation import LOOK_AHEAD
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.models.legs import LEGS
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import ROW_LABELS

SCHEMA_VERSION = 1

# What each array holds; N samples, the first one due at time 0.
ARRAYS = {
    "time": "s, (N,): when the sample is due",
    "q": "(N, 19): R_WB as w, x, y, z; p_WB in m; joints in rad",
    "v": "(N, 18): w_WB_W in rad/s; v_WB_W in m/s; joints in rad/s",
    "vdot": "(N, 18): time derivative of v",
    "contacts": "bool, (N, 4): whether each foot is in stance",
    "labels": "text, (N,): source-gait",
    "set_points": "rad, (N, 12): of the PD, in the period that ends at the sample",
    "feed_forward": "Nm, (N, 12): mean joint torques that set_points contain",
    "path_time": "s, (N,): time in the motion before smoothing",
}


def save_plan(robot: Robot, plan: Plan, duration: float, path: Path) -> None:
    """Writes what a policy needs of ``plan`` for ``duration`` s, atomically.

    These are the samples from the first one on, up to ``duration`` and the last look
    ahead beyond, if the plan has so many. The ``.npz`` holds :data:`ARRAYS` and a
    header, JSON as text: schema_version, robot, joint_names, legs, duration_s,
    period_s and arrays, what each holds. Nothing in it is pickled.
    """
    count = round(duration / PLAN_DT) + 1 + int(LOOK_AHEAD[-1])
    plan = plan.slice(0, count)
    header = {
        "schema_version": SCHEMA_VERSION,
        "version": __version__,
        "robot": robot.name,
        "joint_names": list(robot.joint_names),
        "legs": list(LEGS),
        "duration_s": duration,
        "period_s": PLAN_DT,
        "arrays": ARRAYS,
    }
    arrays: dict[str, Any] = {
        "time": PLAN_DT * np.arange(len(plan)),
        "q": plan.q,
        "v": plan.v,
        "vdot": plan.vdot,
        "contacts": plan.contacts,
        "labels": np.array([str(ROW_LABELS[k]) for k in plan.labels]),
        "set_points": set_points(robot, plan),
        "feed_forward": feed_forward_torques(robot, plan),
        "path_time": plan.path_time - plan.path_time[0],
    }
    with atomic_path(Path(path)) as temporary:
        np.savez_compressed(temporary, header=json.dumps(header), **arrays)
