"""Motion that was steered by random commands, to train on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.control.command import CommandRange
from loco_drake.control.ground_path import ground_pose, path_velocity
from loco_drake.control.plan import Plan, plan_from_motion
from loco_drake.control.state import (
    ANGULAR_VELOCITY,
    JOINT_VELOCITIES,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
)
from loco_drake.control.steering import Steered, begin, steer
from loco_drake.models.robots import Robot
from loco_drake.motion.motion import Motion

PERIOD = 2.0  # s between commands
_RESPONSE = 0.6  # s, as of the scenario's default

# How far commands go for training: backwards and sideways in m/s, turning in rad/s, and
# forward as a share of the motion's own pace, and beyond it.
_BACKWARD, _SIDEWAYS, _TURN = 0.5, 0.35, 1.2
_FASTER, _BEYOND = 1.3, 0.2
# Gaits that also go backwards and on the spot; the others keep this share of the pace.
_SLOW_GAITS = ("walk", "trot", "crawl", "pace", "stilt", "wave")
_SLOWEST = 0.3


def training_range(motion: Motion) -> CommandRange:
    """Returns the commands by which ``motion`` is steered for training."""
    pose = ground_pose(np.hstack((motion.base_quaternion, motion.base_position)))
    pace = float(path_velocity(pose)[:, 0].mean())
    slow = motion.gait in _SLOW_GAITS
    backward = -_BACKWARD * min(1.0, max(pace, 0.2) / 0.8)
    low = backward if slow else _SLOWEST * pace
    turn = _TURN if slow else _TURN / 2
    high = _FASTER * pace + _BEYOND
    return CommandRange((low, -_SIDEWAYS, -turn), (high, _SIDEWAYS, turn))


def steered_motion(robot: Robot, motion: Motion, seed: int | Sequence[int]) -> Motion:
    """Returns ``motion`` steered by commands drawn within its training range.

    A command holds for 2 s. Half of them keep one or two of the three velocities at
    those of the middle of the range, 0 for sideways and turning.

    Args:
        robot: the robot, whose motion it is.
        motion: motion at 50 frames/s.
        seed: of the commands; one number, or several.
    """
    plan = plan_from_motion(robot, motion)
    within = training_range(motion)
    random = np.random.default_rng(seed)
    plain = begin(plan)
    steered: Steered = plain
    commands = []
    for time in np.arange(0.0, plan.end_time, PERIOD):
        commands.append(_drawn(within, random))
        steered = steer(robot, steered, plan, commands[-1], float(time), _RESPONSE)
    apart = np.abs(steered.speed - plain.speed).mean(axis=0)
    return replace(
        moved_as(motion, steered.plan),
        provenance={
            **motion.provenance,
            "steered": "; ".join(
                f"{PERIOD * k:g} s: {', '.join(f'{x:.2f}' for x in c)}"
                for k, c in enumerate(commands)
            ),
            "steered_by": f"{apart[0]:.3f} m/s forward, {apart[1]:.3f} m/s sideways, "
            f"{apart[2]:.3f} rad/s on average",
        },
    )


def moved_as(motion: Motion, plan: Plan) -> Motion:
    """Returns ``motion`` with base and joints of a plan of as many samples."""
    return replace(
        motion,
        base_position=plan.q[POSITION],
        base_quaternion=plan.q[ORIENTATION],
        joint_positions=plan.q[JOINTS],
        base_velocity=plan.v[VELOCITY],
        base_angular_velocity=plan.v[ANGULAR_VELOCITY],
        joint_velocities=plan.v[JOINT_VELOCITIES],
    )


def _drawn(within: CommandRange, random: np.random.Generator) -> Array:
    command: Array = random.uniform(within.low, within.high)
    if random.random() < 0.5:
        keep = random.random(3) < 0.5
        command = np.where(keep, within.middle, command)
    return command
