"""Recorded simulations, and metrics of tracking.

All figures are computed from simulated states and plan states, sampled every PLAN_DT
from time 0, and from the terms of the reward. Samples end when the robot falls.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus
from pydrake.systems.primitives import LogVectorOutput

from loco_drake.common.arrays import Array
from loco_drake.common.gravity import GRAVITY
from loco_drake.common.rotations import (
    quat_error,
    quat_multiply,
    quat_rotate,
    yaw_of,
    yaw_quat,
)
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import (
    HEIGHT,
    JOINT_VELOCITIES,
    JOINTS,
    ORIENTATION,
    POSITION,
    VELOCITY,
    has_fallen,
    split,
)
from loco_drake.models.simulated import SimulatedRobot
from loco_drake.motion.gaits import ROW_LABELS, GaitLabel
from loco_drake.motion.motion import FPS
from loco_drake.motion.quality import stance_slip_speeds
from loco_drake.systems.command_source import CommandSource
from loco_drake.systems.diagram import AddLocomotion
from loco_drake.systems.follow_camera import FollowCamera
from loco_drake.systems.scenario import Scenario
from loco_drake.systems.simulator import MakeSimulator, StartEpisode

# Base errors are re-aligned with the plan this often: they then tell how well the robot
# moves, not how far a small error of heading carries it off in the end.
WINDOW = 2.0  # s
# Enough for smooth motion; every picture more makes a saved page larger.
FRAMES_PER_SECOND = 32.0

_LOGGED = ("state", "plan_state", "path_time", "desired_state", "reward_terms")


@dataclass(frozen=True)
class Rollout:
    """The record of a simulation."""

    state: Array  # the plant's [q, v] at each sample, shape (N + 1, 13 + 2 J)
    plan_state: Array  # the same of the plan
    path_time: Array  # seconds of unsmoothed motion that have passed, shape (N + 1,)
    desired_joints: Array  # set-points of the PD in rad, shape (N + 1, J)
    reward: Array  # of each sample, shape (N + 1,); that of the first is not counted
    steps: int  # how many steps were to be made; more than N if the robot fell
    fell: bool  # whether it did


class Recorder:
    """A locomotion ``diagram`` with a ``simulator`` that logs its ports.

    One diagram serves for any number of episodes. With ``meshcat`` it is drawn, and
    with ``follow`` it stays in the middle of the page. A ``source`` gives command and
    gait; its robot is simulated on when it has fallen, since a driver can put it
    upright again.
    """

    def __init__(
        self,
        scenario: Scenario,
        meshcat: Meshcat | None = None,
        *,
        source: CommandSource | None = None,
        follow: bool = False,
    ) -> None:
        builder = DiagramBuilder()
        self._made = AddLocomotion(builder, scenario, meshcat=meshcat)
        self._ends_at_fall = source is None
        if source is not None:
            builder.AddNamedSystem("command_source", source)
            for name in ("command", "gait"):
                port = self._made.inputs.pop(name)
                builder.Connect(source.GetOutputPort(name), port)
        if follow and meshcat is not None:
            period = scenario.visualization.publish_period
            camera = FollowCamera(self._made.robot, meshcat, period)
            builder.AddNamedSystem("follow_camera", camera)
            builder.Connect(self._made.outputs["state"], camera.GetInputPort("state"))
        self._logs = [
            LogVectorOutput(self._made.outputs[name], builder, publish_period=PLAN_DT)
            for name in _LOGGED
        ]
        self._made.ExportPorts(builder)
        self.diagram = builder.Build()
        self.simulator = MakeSimulator(self.diagram, scenario)
        self.simulator.set_monitor(self._monitor)
        self.fell = False

    @property
    def context(self) -> Context:
        """The diagram's context."""
        return self.simulator.get_mutable_context()

    @property
    def gait(self) -> GaitLabel:
        """The gait of the plan that is tracked, at present."""
        plan = self.diagram.GetOutputPort("plan").Eval(self.context)
        return ROW_LABELS[plan.labels[plan.index(self.context.get_time())]]

    def start(self, **episode: Any) -> None:
        """Starts an episode and clears the logs, see :func:`StartEpisode`."""
        for log in self._logs:
            log.FindMutableLog(self.context).Clear()
        StartEpisode(self.simulator, **episode)
        self.fell = False

    def run(
        self, duration: float, after_step: Callable[[float], bool | None] | None = None
    ) -> tuple[Rollout, float]:
        """Simulates until ``duration`` or a fall; call :meth:`start` first.

        Args:
            duration: context time to stop at, s.
            after_step: called after each control period with the context's time, s;
                False ends the simulation there, as if that were ``duration``.

        Returns:
            The record, and the wall time spent inside AdvanceTo, s.
        """
        steps = round(duration / PLAN_DT)
        wall, done = 0.0, 0
        while done < steps and not self.fell:
            start = time.perf_counter()
            self.simulator.AdvanceTo((done + 1) * PLAN_DT)
            wall += time.perf_counter() - start
            if not self.fell:
                done += 1
                if after_step is not None and after_step(done * PLAN_DT) is False:
                    steps = done
        return self.rollout(done, steps), wall

    def rollout(self, done: int, steps: int) -> Rollout:
        """Returns the record of the first ``done`` of ``steps`` control periods."""
        # Copies, since the logs are cleared. A sample at the moment of a fall is left
        # out: its step was lost.
        state, plan_state, path_time, desired_state, reward_terms = (
            log.FindLog(self.context).data().T[: done + 1].copy() for log in self._logs
        )
        return Rollout(
            state=state,
            plan_state=plan_state,
            path_time=path_time[:, 0],
            desired_joints=desired_state[:, : desired_state.shape[1] // 2],
            reward=reward_terms.sum(axis=1),
            steps=steps,
            fell=self.fell,
        )

    def _monitor(self, root: Context) -> EventStatus:
        q, _ = split(self.diagram.GetOutputPort("state").Eval(root))
        if has_fallen(self._made.robot, q):
            self.fell = True
        if self.fell and self._ends_at_fall:
            return EventStatus.ReachedTermination(self._made.plant, "the robot fell")
        return EventStatus.DidNothing()


def tracking_metrics(rollout: Rollout) -> dict[str, float]:
    """Returns all tracking metrics by name."""
    position, orientation = base_errors(rollout)
    return {
        "normalized_return": normalized_return(rollout),
        "joint_rmse_rad": joint_rmse(rollout),
        "base_position_rmse_m": position,
        "base_orientation_rmse_rad": orientation,
        "stretch": stretch(rollout),
        "speed_mps": speed(rollout),
    }


def normalized_return(rollout: Rollout) -> float:
    """Sum of rewards over its maximum for the whole episode, times 100.

    The maximum is 1 per step. Steps lost to a fall count with a reward of 0.
    """
    return 100 * float(rollout.reward[1:].sum()) / rollout.steps


def joint_rmse(rollout: Rollout) -> float:
    """Root mean square over samples and joints of the angle from the plan, rad."""
    q, _ = split(rollout.state - rollout.plan_state)
    error = q[JOINTS]
    return float(np.sqrt(np.mean(error**2)))


def base_errors(rollout: Rollout) -> tuple[float, float]:
    """Root mean squares of the base's distance (m) and angle (rad) from the plan.

    At the start of each 2 s window the plan is moved in x and y and turned about z so
    that its base is where the robot's is; height, roll and pitch are never aligned.
    The distance is Euclidean, the angle that of the rotation between the two; the mean
    is over all samples.
    """
    own, plan = rollout.state, rollout.plan_state
    samples = round(WINDOW / PLAN_DT)
    start = np.arange(len(own)) // samples * samples  # of each sample's window
    q_own, q_plan = own[ORIENTATION], plan[ORIENTATION]
    turn = yaw_quat((yaw_of(q_own) - yaw_of(q_plan))[start])
    p_plan = quat_rotate(turn, (plan - plan[start])[POSITION])
    p_plan[:, 2] = plan[:, HEIGHT]
    p_own = (own - own[start])[POSITION]
    p_own[:, 2] = own[:, HEIGHT]
    rotation = quat_error(q_own, quat_multiply(turn, q_plan))
    squares = [(error**2).sum(axis=1) for error in (p_own - p_plan, rotation)]
    position, orientation = np.sqrt(np.stack(squares, axis=1).mean(axis=0)).tolist()
    return position, orientation


def stretch(rollout: Rollout) -> float:
    """Duration of the smoothed plan over its duration before smoothing."""
    played = (len(rollout.path_time) - 1) * PLAN_DT
    written = float(rollout.path_time[-1] - rollout.path_time[0])
    return played / written if written > 0 else 1.0


def speed(rollout: Rollout) -> float:
    """Mean over samples of the base's velocity along its own heading, m/s."""
    return float(np.mean(forward_speeds(rollout.state)))


def forward_speeds(state: Array) -> Array:
    """Returns velocities of the base along its heading, m/s, (N,), of states (N, n)."""
    q, v = split(state)
    yaw, v = yaw_of(q[ORIENTATION]), v[VELOCITY]
    forward: Array = v[:, 0] * np.cos(yaw) + v[:, 1] * np.sin(yaw)
    return forward


def slip_speeds(rollout: Rollout, robot: SimulatedRobot) -> Array:
    """Horizontal speeds of the simulated toes in stance, m/s, shape (M,).

    See :func:`loco_drake.motion.quality.stance_slip_speeds`.
    """
    q, _ = split(rollout.state)
    p_BF_W = quat_rotate(q[ORIENTATION][:, None], robot.toe_positions(q[JOINTS]))
    p_WF = q[POSITION][:, None] + p_BF_W
    return stance_slip_speeds(p_WF, robot.foot_radius, FPS)


def effort_metrics(
    rollout: Rollout, robot: SimulatedRobot, damping: Array
) -> dict[str, float]:
    """Returns metrics of the actuators by name.

    With the torque of the PD, tau = kp (q_d - q) - d v, clipped at the effort limit,
    and the ``damping`` d of the PD in the plant, N m s/rad, shape (J,):

    - torque_saturation: share of samples and joints at the effort limit
    - speed_saturation: share of samples and joints at or beyond the speed limit
    - cost_of_transport: mean of sum |tau v| over mass, gravity and mean horizontal
      speed; braking recovers no energy
    """
    q, base_and_joints = split(rollout.state)
    v = base_and_joints[JOINT_VELOCITIES]
    asked = robot.kp * (rollout.desired_joints - q[JOINTS]) - damping * v
    torque = np.clip(asked, -robot.effort_limits, robot.effort_limits)
    power = float(np.abs(torque * v).sum(axis=1).mean())
    speed = float(np.linalg.norm(base_and_joints[VELOCITY][:, :2], axis=1).mean())
    return {
        "torque_saturation": float(np.mean(np.abs(asked) >= robot.effort_limits)),
        "speed_saturation": float(np.mean(np.abs(v) >= robot.joint_speed_limits)),
        "cost_of_transport": power / (robot.mass * GRAVITY * max(speed, 1e-3)),
    }
