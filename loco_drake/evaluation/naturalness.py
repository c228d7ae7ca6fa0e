"""How natural motion is that goes where recorded motion went.

Each recorded trajectory of 2 s sets a task: to go at its velocity, which is averaged
over about two strides around each token. The gait's motion is generated and does the
task in one of several ways (:data:`WAYS`): its plan is bent, or the generator is told
the velocity, or both. A two-sample test (:mod:`.two_sample`) then tells the results
from the recordings; .5 is chance. *Turns* are the trajectories whose yaw rate, averaged
so, has a root mean square of TURN or more.
"""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array, Bools
from loco_drake.control.ground_path import ground_pose, path_velocity
from loco_drake.control.plan import UPDATE_PERIOD, plan_from_motion
from loco_drake.control.steered_motion import moved_as
from loco_drake.control.steering import begin, steer
from loco_drake.evaluation.samples import FRAMES, SECONDS, Samples, make_samples
from loco_drake.evaluation.two_sample import two_sample_accuracy
from loco_drake.generation.features import motion_features
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import MotionModel
from loco_drake.generation.telling import token_velocities
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion import FPS, Motion

# Whether the plan is bent, and the generator told.
WAYS = {
    "bending": (True, False),
    "telling": (False, True),
    "both": (True, True),
}
TURN = 0.15  # rad/s
_LEAD = 2.0  # s before the task, at its first velocity
_PERIOD = 3 * UPDATE_PERIOD  # s between commands
_RESPONSE = 0.6  # s, as of the scenario's default


def task_velocities(model: MotionModel, motions: Sequence[Motion]) -> Array:
    """Returns the tasks of trajectories, velocity of each token in m/s and rad/s.

    Shape (N, tokens, 3); the frames after the last whole token are left out.
    """
    robot = model.robot
    scale = [robot.stand_height, robot.stand_height, 1.0]
    return np.stack(
        [
            token_velocities(
                motion_features(robot, motion.slice(0, FRAMES)), model.frames_per_token
            )
            * scale
            for motion in motions
        ]
    )


def do_tasks(
    model: MotionModel, label: GaitLabel, tasks: Array, way: str | None, seed: int
) -> list[Motion]:
    """Returns motion of 2 s for each task (N, tokens, 3), done in a way of WAYS.

    Without a way, motion that does not know its task. Seeds count up from ``seed``.
    """
    bend, tell = WAYS[way] if way is not None else (False, False)
    token = model.frames_per_token / FPS
    lead = round(_LEAD / token)
    commands = np.concatenate((np.repeat(tasks[:, :1], lead, axis=1), tasks), axis=1)
    first = round(lead * token * FPS)
    motions = generate_motions(
        model,
        label,
        lead * token + SECONDS,
        range(seed, seed + len(tasks)),
        velocity=commands if tell else None,
    )
    if bend:
        motions = [
            _bent(model.robot, motion, of_task, token)
            for motion, of_task in zip(motions, commands, strict=True)
        ]
    return [motion.slice(first, first + FRAMES) for motion in motions]


def _bent(robot: Robot, motion: Motion, commands: Array, token: float) -> Motion:
    """Returns a motion steered by the commands of its tokens, each ``token`` s long."""
    plan = plan_from_motion(robot, motion)
    steered = begin(plan)
    for time in np.arange(0.0, plan.end_time, _PERIOD):
        k = min(round(time / token), len(commands) - 1)
        steered = steer(robot, steered, plan, commands[k], float(time), _RESPONSE)
    return moved_as(motion, steered.plan)


def is_turn(tasks: Array) -> Bools:
    """Returns which tasks (N, tokens, 3) are turns, shape (N,)."""
    turns: Bools = np.sqrt((tasks[..., 2] ** 2).mean(axis=1)) >= TURN
    return turns


def naturalness(
    model: MotionModel, recorded: Sequence[Motion], seeds: int, seed: int
) -> dict[str, Any]:
    """Returns the two-sample accuracies of one label by way.

    They are of all trajectories and of turns, None with fewer than five subjects.
    ``not asked`` is motion that does not know its task: the test's own floor.

    Args:
        model: the motion model.
        recorded: trajectories of one label.
        seeds: how often each task is done.
        seed: the first seed, of motion and of folds.
    """
    robot, label = model.robot, recorded[0].label
    tasks = task_velocities(model, recorded)
    real, turns = make_samples(robot, recorded), is_turn(tasks)
    figures: dict[str, Any] = {"tasks": len(tasks), "turns": int(turns.sum())}
    for way in (None, *WAYS):
        runs = [
            do_tasks(model, label, tasks, way, seed + k * len(tasks))
            for k in range(seeds)
        ]
        errors = np.concatenate([_mean_errors(run, tasks) for run in runs])
        samples = [make_samples(robot, run) for run in runs]
        figures[way or "not asked"] = {
            "two_sample_accuracy": _accuracy(real, samples, seed),
            "two_sample_accuracy_of_turns": _accuracy(
                real[turns], [each[turns] for each in samples], seed
            ),
            "velocity_error_mps": float(np.hypot(*errors[:, :2].T).mean()),
            "yaw_rate_error_radps": float(np.abs(errors[:, 2]).mean()),
        }
    return figures


def _mean_errors(motions: Sequence[Motion], tasks: Array) -> Array:
    """Returns by how much mean velocities of motions are off their tasks', (N, 3)."""
    means = [
        path_velocity(
            ground_pose(np.hstack((m.base_quaternion, m.base_position)))
        ).mean(axis=0)
        for m in motions
    ]
    return np.array(means) - tasks.mean(axis=1)


def _accuracy(
    real: Samples, runs: Sequence[Samples], seed: int
) -> dict[str, float] | None:
    """Returns the mean estimate over runs."""
    found = [
        two_sample_accuracy(real, run, [seed + k]) if len(real) else None
        for k, run in enumerate(runs)
    ]
    if any(estimate is None for estimate in found):
        return None
    columns = [asdict(estimate) for estimate in found if estimate is not None]
    return {key: float(np.mean([c[key] for c in columns])) for key in columns[0]}
