"""A robot on flat ground in MuJoCo, with the state of its Drake plant."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_number, one_line
from loco_drake.common.rotations import quat_conjugate, quat_rotate

from .mjcf import OPTIONS, TIME_STEP, robot_mjcf
from .robots import Robot


@dataclass(kw_only=True)
class MujocoConfig:
    """Time step, ground and model of a simulation in MuJoCo."""

    # Time step, s.
    time_step: float = TIME_STEP
    # Coulomb friction coefficient of the ground; not with a model of your own.
    friction: float = 0.8
    # MJCF of another model of the robot; by default robot_mjcf writes it.
    mjcf: Path | None = None

    def check(self) -> None:
        """Raises InputError if a field is not sound, or MuJoCo is not installed."""
        import_mujoco()
        if self.mjcf is not None and not self.mjcf.is_file():
            raise InputError(f"There is no MJCF file {str(self.mjcf)!r}.")
        check_number("The plant's time_step", self.time_step, 1e-5, 0.01)
        check_number("The plant's friction", self.friction, 1e-6, 1e3)
        if self.mjcf is not None and self.friction != MujocoConfig().friction:
            raise InputError("The friction of another model is set in its MJCF file.")


def import_mujoco() -> Any:
    """Returns the module mujoco; raises InputError if it is not installed."""
    try:
        import mujoco
    except ImportError:
        raise InputError(
            "To simulate in MuJoCo, install the package mujoco, the extra 'mujoco' of "
            "loco_drake."
        ) from None
    return mujoco


class MujocoPlant:
    """A robot in MuJoCo whose joints are driven by the motors' PD.

    States are those of the Drake plant, see :mod:`loco_drake.control.state`. Whatever
    the model, its joints are found by their names, its actuators are replaced by the PD
    with the gains and effort limits of ``robot``, which MuJoCo computes at every time
    step, and integrator and friction cones are those of :mod:`.mjcf`. A model's own
    damping of the joints counts as a part of the PD's. A model without a plane or
    height field gets a ground.

    Raises:
        InputError: if the model cannot be read, lacks joints of the robot, or has no
            floating base.
    """

    def __init__(self, robot: Robot, config: MujocoConfig) -> None:
        config.check()
        self._mujoco = import_mujoco()
        # MuJoCo would write its warnings to a file in the working folder.
        self._mujoco.set_mju_user_warning(_ignore)
        self.model = self._load(robot, config)
        self.data = self._mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joint_names]
        base = [j for j in range(self.model.njnt) if self.model.jnt_type[j] == 0]
        q, v = self.model.jnt_qposadr[base[0]], self.model.jnt_dofadr[base[0]]
        self._p, self._quat = slice(q, q + 3), slice(q + 3, q + 7)
        self._v, self._w = slice(v, v + 3), slice(v + 3, v + 6)
        self._q_joints = np.array([joint.qposadr[0] for joint in joints])
        self._v_joints = np.array([joint.dofadr[0] for joint in joints])
        # Whatever damps the joints of another model stands for a part of the motors'.
        damping = robot.kd - self.model.dof_damping[self._v_joints]
        self.model.actuator_biasprm[:, 2] = -np.maximum(damping, 0.0)

    def _load(self, robot: Robot, config: MujocoConfig) -> Any:
        mujoco = self._mujoco
        name = "The robot's model" if config.mjcf is None else str(config.mjcf)
        try:
            if config.mjcf is None:
                text = robot_mjcf(robot, friction=config.friction)
                spec = mujoco.MjSpec.from_string(text)
            else:
                spec = mujoco.MjSpec.from_file(str(config.mjcf))
            _check_joints(mujoco, spec, robot, name)
            _drive(mujoco, spec, robot)
            spec.option.timestep = config.time_step
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
            spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
            spec.option.impratio = OPTIONS["impratio"]
            # Otherwise a robot whose state explodes would start again at its first.
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
            return spec.compile()
        except (ValueError, RuntimeError, mujoco.FatalError) as error:
            raise InputError(
                f"{name} cannot be read as MJCF: {one_line(str(error))}"
            ) from None

    @property
    def state(self) -> Array:
        """The state [q, v], shape (37,), in the order of the Drake plant."""
        q, v = self.data.qpos, self.data.qvel
        quat = q[self._quat]
        # MuJoCo has the base's angular velocity in B, Drake in W.
        w_WB_W = quat_rotate(quat, v[self._w])
        positions = quat, q[self._p], q[self._q_joints]
        return np.concatenate((*positions, w_WB_W, v[self._v], v[self._v_joints]))

    def set_state(self, state: Array) -> None:
        """Starts from a state [q, v], shape (37,), at time 0."""
        self._mujoco.mj_resetData(self.model, self.data)
        q, v = self.data.qpos, self.data.qvel
        q[self._quat], q[self._p], q[self._q_joints] = np.split(state[:19], [4, 7])
        w_WB_W, v[self._v], v[self._v_joints] = np.split(state[19:], [3, 6])
        v[self._w] = quat_rotate(quat_conjugate(state[:4]), w_WB_W)
        self._mujoco.mj_forward(self.model, self.data)

    def advance(self, q_d: Array, duration: float) -> Array:
        """Returns the state after ``duration`` s with the set-points ``q_d``, (12,)."""
        self.data.ctrl[:] = q_d
        steps = round(duration / self.model.opt.timestep)
        self._mujoco.mj_step(self.model, self.data, steps)
        return self.state


def _check_joints(mujoco: Any, spec: Any, robot: Robot, name: str) -> None:
    """Raises InputError if a joint is missing or there is not one free joint."""
    kinds = {joint.name: joint.type for joint in spec.joints}
    hinge, free = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_FREE
    missing = [n for n in robot.joint_names if kinds.get(n) != hinge]
    if missing:
        raise InputError(
            f"{name} lacks the hinge joints {', '.join(missing)} of {robot.name}; it "
            f"has {', '.join(filter(None, kinds)) or 'none'}."
        )
    if sum(joint.type == free for joint in spec.joints) != 1:
        raise InputError(f"{name} must have one free joint, that of the trunk.")


def _drive(mujoco: Any, spec: Any, robot: Robot) -> None:
    """Replaces the actuators by the PD of ``robot``, and adds a ground if needed."""
    # Key frames and sensors may depend on the actuators.
    for element in (*spec.keys, *spec.sensors, *spec.actuators):
        spec.delete(element)
    for name, kp, kd, effort in zip(
        robot.joint_names, robot.kp, robot.kd, robot.effort_limits, strict=True
    ):
        actuator = spec.add_actuator(
            name=f"{name}_pd",
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=True,
            forcerange=[-effort, effort],
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        )
        actuator.gainprm[0] = kp
        actuator.biasprm[1:3] = -kp, -kd
    planes = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    if not any(geom.type in planes for geom in spec.geoms):
        spec.worldbody.add_geom(type=planes[0], size=[0, 0, 1])


def _ignore(message: str) -> None:
    """Ignores a warning: a robot whose state is not finite has fallen."""
