"""A trot without feedback, to try plants and contact models with."""

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from loco_drake.models.robots import Robot

Array = NDArray[np.float64]

_PHASES = np.array([0.0, 0.5, 0.5, 0.0])  # diagonal legs together
_DUTY = 0.6  # part of the period that a leg is in stance
_LOADING = 0.1  # part of the period over which a leg takes up its load
_RAMP = 0.5  # s from standing to full strides
_GRAVITY = 9.81  # m/s^2


def trot_joints(
    robot: Robot,
    times: Array,
    *,
    speed: float = 0.4,
    period: float = 0.5,
    lift: float = 0.05,
) -> Array:
    """Returns joint targets of a trot, to be sent to the PD with v_d = 0.

    In stance a toe moves straight back at ``speed``; in swing it returns along a
    cosine, lifted by a sine squared. Strides grow over the first half second. The
    targets lead the toes' path by what makes the PD give the torque that carries the
    weight, J' f / kp, and by what its damping would hold back, (kd / kp) v: without
    that a trot sinks and stumbles, and how it stumbles says little about contact.

    Args:
        robot: who trots.
        times: s, evenly spaced, shape (T,), T at least 2.
        speed: of the toes against the trunk, m/s.
        period: of a stride, s.
        lift: height of the toes in mid swing, m.

    Returns:
        joints in rad, shape (T, 12).
    """
    phase = (times[:, None] / period + _PHASES) % 1.0
    stance = phase / _DUTY
    swing = np.clip((phase - _DUTY) / (1 - _DUTY), 0.0, 1.0)
    stride = speed * period * _DUTY
    ramp = np.clip(times / _RAMP, 0.0, 1.0)[:, None]
    p_BF = np.tile(robot.toe_positions(robot.stand_joints), (len(times), 1, 1))
    forward = np.where(stance < 1, 0.5 - stance, -0.5 * np.cos(np.pi * swing))
    p_BF[..., 0] += ramp * stride * forward
    p_BF[..., 2] += ramp * lift * np.sin(np.pi * swing) ** 2
    joints = robot.leg_joints(p_BF)

    load = np.clip(np.minimum(phase, _DUTY - phase) / _LOADING, 0.0, 1.0)
    load /= load.sum(axis=1, keepdims=True)
    f_F = np.zeros_like(p_BF)
    f_F[..., 2] = robot.mass * _GRAVITY * load
    torques = -np.einsum("tlij,tli->tlj", robot.toe_jacobians(joints), f_F)
    velocities = np.gradient(joints, times, axis=0)
    return joints + (torques.reshape(joints.shape) + robot.kd * velocities) / robot.kp


def AddTrotSource(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    robot: Robot,
    *,
    duration: float,
    speed: float = 0.4,
) -> TrajectorySource:
    """Connects :func:`trot_joints` to the PD of a robot's plant.

    Args:
        builder: of the diagram that holds ``plant``.
        plant: from :func:`loco_drake.models.plant.AddRobotPlant`.
        instance: the robot's model instance in it.
        robot: who trots.
        duration: s; afterwards the last target is held.
        speed: as in :func:`trot_joints`.

    Returns:
        The source, named "trot".
    """
    times = np.linspace(0.0, duration, round(duration / 0.02) + 1)
    joints = trot_joints(robot, times, speed=speed)
    samples = np.hstack((joints, np.zeros_like(joints)))
    trajectory = PiecewisePolynomial.FirstOrderHold(times, samples.T)
    source = builder.AddNamedSystem("trot", TrajectorySource(trajectory))
    builder.Connect(
        source.get_output_port(), plant.get_desired_state_input_port(instance)
    )
    return source
