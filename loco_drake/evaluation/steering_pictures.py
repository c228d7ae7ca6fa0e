"""Pictures of a robot that is steered: its response to commands, a figure of eight."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from loco_drake.common.arrays import Array
from loco_drake.control.command import CommandRange
from loco_drake.control.ground_path import ground_pose, integrate
from loco_drake.control.plan import PLAN_DT
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.steering import stride_velocity
from loco_drake.evaluation.steering_grid import draw_grid, grid_errors
from loco_drake.evaluation.tracking import Recorder
from loco_drake.models.robots import Robot, get_robot
from loco_drake.systems.scenario import Scenario

_SECONDS, _CHANGE = 24.0, 2.0  # of the drive whose response is drawn
_SPEED, _YAW_RATE = 0.8, 0.8  # of the figure of eight, m/s and rad/s
# A gait that turns no faster than this does not get round in time, rad/s.
_LEAST_YAW_RATE = 0.2
_AXES = ("forward, m/s", "sideways, m/s", "yaw rate, rad/s")
# Told apart by the colour-blind, and in grey by their dashes.
_COMMAND: dict[str, Any] = {"color": "0.25", "lw": 1.2, "ls": "--"}
_PLAN: dict[str, Any] = {"color": "#e69f00", "lw": 2.6}
_ROBOT: dict[str, Any] = {"color": "#0072b2", "lw": 1.4}


@dataclass(frozen=True)
class Drive:
    """A simulated robot that is steered, sampled every PLAN_DT."""

    robot: Robot
    label: str  # the gait
    command: Array  # at each sample, shape (N + 1, 3)
    state: Array  # the plant's [q, v], shape (N + 1, 37)
    plan_state: Array  # the same of the plan
    fell: bool  # whether the robot fell at the end

    @property
    def title(self) -> str:
        """Robot, gait, and when the robot fell if it did."""
        end = f", fell after {len(self.state) * PLAN_DT:.1f} s" if self.fell else ""
        return f"{self.robot.name}, {self.label}{end}"


def steering_figures(
    scenario: Scenario, figures: Mapping[str, Any], seed: int
) -> Iterator[tuple[str, Figure]]:
    """Yields all pictures of ``evaluate steering`` of one robot, by name.

    Of each label they show the first drive, and a figure of eight at .8 m/s and
    .8 rad/s, or as near as its range permits.

    Args:
        scenario: that of the evaluation.
        figures: what the evaluation found of the robot.
        seed: that of the first drive.
    """
    yield "grid", grid_figure(scenario.robot, figures)
    recorder = Recorder(scenario)
    robot = get_robot(scenario.robot)
    for label, of_label in figures["labels"].items():
        within = CommandRange.of_figures(of_label["range"])
        drive = first_drive(recorder, robot, label, within, seed)
        yield f"{label}-response", response_figure(drive)
        course = figure_of_eight(within)
        if course is not None:
            drive = run_drive(recorder, robot, label, seed, course)
            yield f"{label}-eight", eight_figure(drive)


def grid_figure(robot: str, figures: Mapping[str, Any]) -> Figure:
    """Returns the errors of all labels over the grid."""
    errors = grid_errors(Figures(dict(figures)))
    figure = Figure(figsize=(11, 2.4 + 0.5 * len(errors)), layout="constrained")
    figure.suptitle(f"{robot}: mean velocity at each command of the grid", size=11)
    draw_grid(figure, errors)
    return figure


def first_drive(
    recorder: Recorder, robot: Robot, label: str, within: CommandRange, seed: int
) -> Drive:
    """Returns the first 24 s of a random drive of ``evaluate steering``."""
    random = np.random.default_rng(seed)
    table = random.uniform(within.low, within.high, (round(_SECONDS / _CHANGE), 3))
    commands = np.repeat(table, round(_CHANGE / PLAN_DT), axis=0)
    return run_drive(recorder, robot, label, seed, commands)


def figure_of_eight(
    within: CommandRange, speed: float = _SPEED, yaw_rate: float = _YAW_RATE
) -> Array | None:
    """Returns commands of a full circle to the left and one to the right, (N, 3).

    They are kept within a range; None if that permits no more than .2 rad/s.
    """
    turning = min(yaw_rate, within.high[2], -within.low[2])
    if turning <= _LEAST_YAW_RATE:
        return None
    circle = np.array([speed, 0.0, turning])
    samples = round(2 * np.pi / turning / PLAN_DT)
    both = [within.clip(circle * [1.0, 1.0, side]) for side in (1.0, -1.0)]
    return np.repeat(both, samples, axis=0)


def run_drive(
    recorder: Recorder, robot: Robot, label: str, seed: int, commands: Array
) -> Drive:
    """Simulates commands (N, 3), one for each PLAN_DT, or until the robot falls."""
    recorder.start(gait=label, seed=seed)
    port = recorder.diagram.GetInputPort("command")

    def after_step(time: float) -> None:
        sample = min(round(time / PLAN_DT), len(commands) - 1)
        port.FixValue(recorder.context, commands[sample])

    after_step(0.0)
    rollout, _ = recorder.run(len(commands) * PLAN_DT, after_step)
    samples = np.minimum(np.arange(len(rollout.state)), len(commands) - 1)
    return Drive(
        robot=robot,
        label=label,
        command=commands[samples],
        state=rollout.state,
        plan_state=rollout.plan_state,
        fell=rollout.fell,
    )


def response_figure(drive: Drive) -> Figure:
    """Returns command, plan and robot over time, velocities averaged over a stride."""
    time = np.arange(len(drive.state)) * PLAN_DT
    figure = Figure(figsize=(11, 5.6), layout="constrained")
    rows = figure.subplots(3, 1, sharex=True)
    curves = {
        "plan, mean over a stride": (
            stride_velocity(drive.robot, drive.plan_state),
            _PLAN,
        ),
        "robot, mean over a stride": (
            stride_velocity(drive.robot, drive.state),
            _ROBOT,
        ),
    }
    for k, (axes, name) in enumerate(zip(rows, _AXES, strict=True)):
        axes.step(time, drive.command[:, k], where="post", label="command", **_COMMAND)
        for what, (velocity, style) in curves.items():
            axes.plot(time, velocity[:, k], label=what, **style)
        axes.set_ylabel(name)
        axes.grid(alpha=0.3)
    figure.align_ylabels()
    rows[-1].set(xlabel="time, s", xlim=(0, time[-1]))
    rows[0].set_title(drive.title, size=11, loc="left")
    handles, names = rows[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper right", ncols=3, frameon=False)
    return figure


def eight_figure(drive: Drive) -> Figure:
    """Returns the robot's path on the ground beside that of its commands."""
    start = ground_pose(drive.state)[0]
    ideal = np.vstack((start, integrate(start, drive.command[:-1])))
    paths = {
        "as commanded": (ideal, _COMMAND),
        "plan": (ground_pose(drive.plan_state), _PLAN),
        "robot": (ground_pose(drive.state), _ROBOT),
    }
    width, height = np.ptp(np.vstack([path for path, _ in paths.values()]), axis=0)[:2]
    ratio = np.clip(width / max(height, 0.1), 0.4, 2.0)
    figure = Figure(figsize=(2.8 + 4.6 * ratio, 5.4), layout="constrained")
    axes = figure.add_subplot()
    for name, (path, style) in paths.items():
        axes.plot(path[:, 0], path[:, 1], label=name, **style)
    axes.plot(*start[:2], "o", color="0.25", ms=6, label="start")
    end = paths["robot"][0][-1]
    axes.plot(*end[:2], "s", color=_ROBOT["color"], ms=6, label="end of the robot")
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    axes.grid(alpha=0.3)
    speed, _, yaw_rate = drive.command[0]
    axes.set_title(f"{drive.title}\n{speed:.2g} m/s, {yaw_rate:.2g} rad/s", size=11)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure
