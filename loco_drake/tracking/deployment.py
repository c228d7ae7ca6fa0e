"""What a stranger needs to run an exported policy, as JSON; docs/deploy.md explains it.

Symbols: W is the world, z up, ground at z = 0; B the robot's trunk; H the heading
frame, at B, z up, its x that of B in the plane; P the plan's trunk. The plan's sample n
is due now; q_J and v_J are the joints. R' is the transpose of R.
"""

from typing import Any, NamedTuple

from loco_drake.common.gravity import GRAVITY
from loco_drake.control.action import velocity_gain
from loco_drake.control.actor import PRIVILEGED, Actor
from loco_drake.control.feed_forward import (
    DAMPING,
    FRICTION,
    MAX_LOAD,
    MOMENT_WEIGHT,
)
from loco_drake.control.observation import (
    LOOK_AHEAD,
    OBSERVATION_LAYOUT,
    OBSERVATION_SIZE,
    PLACES,
)
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import MAX_TILT
from loco_drake.models.legs import LEGS
from loco_drake.models.mjcf import TIME_STEP
from loco_drake.models.plant import PlantConfig, plant_damping
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import GAITS, SOURCES
from loco_drake.tracking.deployment_vectors import TOLERANCE, make_vectors

SCHEMA_VERSION = 2


class Part(NamedTuple):
    """Definition of a part of the observation: scale times formula."""

    unit: str  # of the formula's values
    frame: str  # that they are expressed in
    formula: str
    samples: str = "now"  # key of SAMPLES: of the plan that it is of
    scale: float = 1.0  # one per unit


PARTS = {
    "gravity_B": Part("1", "B", "R_WB' (0, 0, -1)"),
    "w_WB_B": Part("rad/s", "B", "R_WB' w_WB_W"),
    "v_WB_H": Part("m/s", "H", "R_WH' v_WB_W"),
    "height": Part("m", "W", "p_WB[2]"),
    "joint_positions": Part("rad", "joints", "q_J - standing_rad"),
    "joint_velocities": Part("rad/s", "joints", "v_J", scale=0.1),
    "last_action": Part(
        "1", "joints", "action of the period before; zeros in the first"
    ),
    "plan_joint_velocities": Part("rad/s", "joints", "plan v_J", "next", 0.1),
    "plan_joints": Part("rad", "joints", "plan q_J - q_J", "ahead"),
    "plan_p_H": Part("m", "H", "R_WH' (p_WP - p_WB)", "ahead"),
    "plan_R_B": Part("rad", "B", "rotation vector of R_WB' R_WP", "ahead"),
    "plan_v_H": Part("m/s", "H", "R_WH' v_WP_W", "ahead"),
    "plan_w_H": Part("rad/s", "H", "R_WH' w_WP_W", "ahead"),
    "plan_contacts": Part("1", "legs", "1 in stance, else 0", "ahead"),
    "label": Part("1", "label", "one-hot of the source, one-hot of the gait"),
}
# Samples of the plan, counted from n. A part holds all numbers of one sample, then
# those of the next.
SAMPLES = {"now": [0], "next": [1], "ahead": LOOK_AHEAD.tolist()}

FORMULAS = {
    "set_points": (
        "q_J of the plan's sample n + 1, plus (velocity_gain v_J + tau) / kp with v "
        "the mean of the samples n and n + 1"
    ),
    "feed_forward": (
        "tau = (M vdot + h)_J - sum of J' f over the feet in stance at n + 1; M and h "
        "are mass matrix and bias forces, gravity included, at the mean q and v of the "
        "samples n and n + 1, vdot = (v(n + 1) - v(n)) / period, and J is d p_WF / d "
        "q_J. The forces f minimize |w (G f - (M vdot + h)_B)|^2 + damping |f - f_0|^2 "
        "with G f their moment about and their force on the base, w = moment_weight of "
        "moments and 1 of forces, and f_0 = (0, 0, mass max(0, g + vdot_z) / number of "
        "feet in stance). Then f_z is clipped to 0 .. max_load mass g, and the "
        "horizontal part shortened to friction f_z"
    ),
    "target": "q_d = set_points + scale * action, held until the next action",
    "torque": "clip(kp (q_d - q_J) - kd v_J, -effort, effort)",
    "fallen": "a corner of the trunk's box is at z <= 0, or its z axis tilts further",
}


def deployment(actor: Actor, robot: Robot) -> dict[str, Any]:
    """Returns what it takes to run a policy of ``robot``, ready for JSON."""
    config = actor.config
    return {
        "schema_version": SCHEMA_VERSION,
        "robot": robot.name,
        "labels": config.labels,
        "network": {
            "input": {"name": "observation", "shape": ["N", OBSERVATION_SIZE]},
            "output": {"name": "action", "shape": ["N", len(robot.joint_names)]},
            "type": "float32",
            "period_s": 1 / config.rate,
        },
        "memory": _memory(actor),
        "state": {
            "q": ["R_WB as w, x, y, z", "p_WB in m", "q_J in rad"],
            "v": ["w_WB_W in rad/s", "v_WB_W in m/s", "v_J in rad/s"],
            "B": "between the hip joints, x forward, y left, z up",
            "H": "at B, z up, x that of B in the plane",
            "W": "z up, ground at z = 0",
        },
        "observation": _observation(actor),
        "look_ahead": {
            "samples": SAMPLES["ahead"],
            "period_s": PLAN_DT,
            "beyond_the_end": "the last sample",
        },
        "label": {
            "sources": list(SOURCES),
            "gaits": list(GAITS),
            "written": "source-gait",
            "others": "zeros",
        },
        "legs": list(LEGS),
        "joints": {
            "names": list(robot.joint_names),
            "standing_rad": robot.stand_joints.tolist(),
            "lower_rad": robot.joint_lower.tolist(),
            "upper_rad": robot.joint_upper.tolist(),
            "speed_radps": robot.joint_speed_limits.tolist(),
            "effort_nm": robot.effort_limits.tolist(),
        },
        "action": {
            "scale_rad": config.action_scale,
            "target": FORMULAS["target"],
            "set_points": FORMULAS["set_points"],
        },
        "feed_forward": {
            "formula": FORMULAS["feed_forward"],
            "velocity_gain_nms_per_rad": velocity_gain(robot).tolist(),
            "mass_kg": robot.mass,
            "g_mps2": GRAVITY,
            "max_load": MAX_LOAD,
            "friction": FRICTION,
            "moment_weight_per_m": MOMENT_WEIGHT,
            "damping": DAMPING,
        },
        "pd": {
            "torque": FORMULAS["torque"],
            "kp_nm_per_rad": robot.kp.tolist(),
            "kd_nms_per_rad": robot.kd.tolist(),
            "period_s": TIME_STEP,
            "drake": {
                "step_s": PlantConfig().time_step,
                "kd_nms_per_rad": plant_damping(robot, PlantConfig()).tolist(),
            },
        },
        "start": {"state": "the plan's first sample", "action": "zeros"},
        "fallen": {
            "rule": FORMULAS["fallen"],
            "trunk_size_m": robot.trunk_size.tolist(),
            "tilt_rad": float(MAX_TILT),
        },
        "test_vectors": make_vectors(actor, robot),
        "test_tolerance": TOLERANCE,
    }


def ignored_parts(actor: Actor) -> tuple[str, ...]:
    """Returns the parts of the observation that make no difference to the action."""
    if actor.config.privileged:
        return ()
    # With a history, the plan's own motion and height are taken from the other two;
    # the robot's position in them makes no difference.
    return PRIVILEGED if actor.config.history is None else ("v_WB_H",)


def _memory(actor: Actor) -> dict[str, Any] | None:
    """Returns what the network is to be given back, or None."""
    if not actor.memory_size:
        return None
    shape = ["N", actor.memory_size]
    return {
        "input": {"name": "memory", "shape": shape},
        "output": {"name": "next_memory", "shape": shape},
        "start": "zeros",
        "p_WB": "of no consequence, may be zeros",
    }


def _observation(actor: Actor) -> list[dict[str, Any]]:
    """Returns the parts in order, with the place of each in the observation."""
    ignored = ignored_parts(actor)
    return [
        {
            "name": name,
            "start": PLACES[name].start,
            "size": size,
            **PARTS[name]._asdict(),
            "samples": SAMPLES[PARTS[name].samples],
            "ignored": name in ignored,
        }
        for name, size in OBSERVATION_LAYOUT
    ]
