"""Run an exported policy in MuJoCo, with onnxruntime, NumPy and MuJoCo alone.

One command of loco_drake writes the three files, docs/deploy.md says what is in them:

    loco-drake export --onnx policy.onnx --plans plans.npz --mjcf go2.xml
"""

import argparse
import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import onnxruntime
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Robot:
    """A robot in MuJoCo: reads q and v in the order of policy and plan."""

    def __init__(self, mjcf: Path, joints: list[str]) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(mjcf))
        self.data = mujoco.MjData(self.model)
        self._q = [self.model.joint(name).qposadr[0] for name in joints]
        self._v = [self.model.joint(name).dofadr[0] for name in joints]
        # Position actuators, which are the PD, of the same names.
        names = [name.removesuffix("_joint") for name in joints]
        self._actuators = [self.model.actuator(name).id for name in names]

    def place(self, q: Array, v: Array) -> None:
        """Puts the robot into a state; MuJoCo has the position first, and w in B."""
        data = self.data
        data.qpos[:3], data.qpos[3:7], data.qpos[self._q] = q[4:7], q[:4], q[7:]
        data.qvel[:3], data.qvel[3:6] = v[3:6], rotation(q[:4]).T @ v[:3]
        data.qvel[self._v] = v[6:]
        mujoco.mj_forward(self.model, data)

    def state(self) -> tuple[Array, Array]:
        """Returns q, shape (19,), and v, shape (18,)."""
        p, quaternion = self.data.qpos[:3], self.data.qpos[3:7]
        w_W = rotation(quaternion) @ self.data.qvel[3:6]
        q = np.concatenate((quaternion, p, self.data.qpos[self._q]))
        v = np.concatenate((w_W, self.data.qvel[:3], self.data.qvel[self._v]))
        return q, v

    def advance(self, target: Array, period: float) -> None:
        """Holds set-points, rad, shape (12,), for ``period`` s."""
        self.data.ctrl[self._actuators] = target
        steps = round(period / self.model.opt.timestep)
        mujoco.mj_step(self.model, self.data, steps)


class Policy:
    """A policy, and what its file says of it."""

    def __init__(self, path: Path) -> None:
        self._session = onnxruntime.InferenceSession(
            path, providers=["CPUExecutionProvider"]
        )
        metadata = self._session.get_modelmeta().custom_metadata_map
        if "deployment" not in metadata:
            raise SystemExit(f"{path} says not how to run it: export the policy anew.")
        self.about: dict[str, Any] = json.loads(metadata["deployment"])
        self.memory = np.zeros(0)
        self.begin()

    def begin(self) -> None:
        """Begins an episode: a policy with a history remembers nothing."""
        memory = self.about.get("memory")
        self.memory = np.zeros(memory["input"]["shape"][1] if memory else 0)

    def act(self, observation: Array) -> Array:
        """Returns the action, shape (12,), and remembers what the network says."""
        inputs = {"observation": observation}
        if self.memory.size:
            inputs["memory"] = self.memory
        batches = {name: x[None].astype(np.float32) for name, x in inputs.items()}
        action, *memory = self._session.run(None, batches)
        if memory:
            self.memory = memory[0][0].astype(np.float64)
        result: Array = action[0].astype(np.float64)
        return result

    def check(self) -> float:
        """Returns the largest error in the file's test vectors."""
        errors = []
        for case in self.about["test_vectors"]:
            known = {k: np.array(x) for k, x in case.items() if k != "label"}
            ahead = {name: known[f"plan_{name}"] for name in ("q", "v", "contacts")}
            ahead["label"] = one_hot(self.about, case["label"])
            state = known["q"], known["v"], known["last_action"]
            observation = observe(self.about, ahead, *state)
            self.memory = known.get("memory", self.memory)
            action = self.act(observation)
            if "memory" in known:
                errors.append(self.memory - known["next_memory"])
            errors += [observation - known["observation"], action - known["action"]]
            errors.append(self.target(known["set_points"], action) - known["target"])
        return max(float(np.abs(error).max()) for error in errors)

    def target(self, set_points: Array, action: Array) -> Array:
        """Returns what the PD is given, rad, shape (12,)."""
        q_d: Array = set_points + self.about["action"]["scale_rad"] * action
        return q_d


def rotation(quaternion: Array) -> Array:
    """Returns the rotation matrix of a unit quaternion w, x, y, z."""
    w, (x, y, z) = quaternion[0], quaternion[1:]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def rotation_vector(q_WB: Array, q_WP: Array) -> Array:
    """Returns axis times angle, rad, of the rotation from B to P, expressed in B."""
    (w, a), (u, b) = (q_WB[0], q_WB[1:]), (q_WP[0], q_WP[1:])
    real, imaginary = w * u + a @ b, w * b - u * a - np.cross(a, b)
    if real < 0:  # the same rotation, the short way
        real, imaginary = -real, -imaginary
    sine = float(np.linalg.norm(imaginary))
    scale = 2 * np.arctan2(sine, real) / sine if sine > 1e-9 else 2.0
    vector: Array = scale * imaginary
    return vector


def one_hot(about: dict[str, Any], label: str) -> Array:
    """Returns the code of a label, source-gait."""
    source, gait = label.split("-", 1)
    sources, gaits = about["label"]["sources"], about["label"]["gaits"]
    return np.array([source == s for s in sources] + [gait == g for g in gaits], float)


def look_ahead(about: dict[str, Any], plan: dict[str, Array], n: int) -> dict[str, Any]:
    """Returns what is observed of the plan when its sample ``n`` is due."""
    samples = n + np.array(about["look_ahead"]["samples"])
    k = np.minimum(samples, len(plan["q"]) - 1)
    ahead: dict[str, Any] = {name: plan[name][k] for name in ("q", "v", "contacts")}
    return {**ahead, "label": one_hot(about, str(plan["labels"][n]))}


def observe(
    about: dict[str, Any], ahead: dict[str, Array], q: Array, v: Array, action: Array
) -> Array:
    """Returns the observation, from the state q (19,), v (18,) and the last action."""
    R_WB = rotation(q[:4])
    x, y = R_WB[:2, 0] / np.linalg.norm(R_WB[:2, 0])
    R_WH = np.array([[x, -y, 0], [y, x, 0], [0, 0, 1]])
    plan_q, plan_v = ahead["q"], ahead["v"]
    # Row vectors times R are the vectors in the frame of R.
    values = {
        "gravity_B": np.array([0, 0, -1]) @ R_WB,
        "w_WB_B": v[:3] @ R_WB,
        "v_WB_H": v[3:6] @ R_WH,
        "height": q[6],
        "joint_positions": q[7:] - about["joints"]["standing_rad"],
        "joint_velocities": v[6:],
        "last_action": action,
        "plan_joint_velocities": plan_v[0, 6:],
        "plan_joints": plan_q[:, 7:] - q[7:],
        "plan_p_H": (plan_q[:, 4:7] - q[4:7]) @ R_WH,
        "plan_R_B": [rotation_vector(q[:4], other) for other in plan_q[:, :4]],
        "plan_v_H": plan_v[:, 3:6] @ R_WH,
        "plan_w_H": plan_v[:, :3] @ R_WH,
        "plan_contacts": ahead["contacts"],
        "label": ahead["label"],
    }
    parts = about["observation"]
    return np.concatenate([p["scale"] * np.ravel(values[p["name"]]) for p in parts])


def has_fallen(about: dict[str, Any], q: Array) -> bool:
    """Returns whether the trunk tilts too far or touches the ground."""
    up_B = rotation(q[:4])[2]
    lowest = q[6] - np.abs(up_B) @ about["fallen"]["trunk_size_m"] / 2
    return bool(lowest <= 0 or up_B[2] < np.cos(about["fallen"]["tilt_rad"]))


def deploy(policy: Policy, plan: dict[str, Array], robot: Robot) -> dict[str, Any]:
    """Follows the plan until its end or a fall; returns figures."""
    about = policy.about
    period = about["network"]["period_s"]
    steps = len(plan["q"]) - 1 - max(about["look_ahead"]["samples"])
    robot.place(plan["q"][0], plan["v"][0])
    policy.begin()
    action = np.zeros(12)
    errors, fell = [np.zeros(12)], False
    for n in range(steps):
        q, v = robot.state()
        action = policy.act(observe(about, look_ahead(about, plan, n), q, v, action))
        robot.advance(policy.target(plan["set_points"][n + 1], action), period)
        q, _ = robot.state()
        fell = has_fallen(about, q)
        if fell:
            break
        errors.append(q[7:] - plan["q"][n + 1, 7:])
    return {
        "simulated_s": (len(errors) - 1) * period,
        "planned_s": steps * period,
        "fell": fell,
        "joint_rmse_rad": float(np.sqrt(np.square(errors).mean())),
        "from_plan_m": float(np.linalg.norm(q[4:7] - plan["q"][n + 1, 4:7])),
    }


def main() -> None:
    """Reads the files, checks the test vectors, runs the policy and prints figures."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    for name, default in (
        ("policy", "policy.onnx"),
        ("plans", "plans.npz"),
        ("mjcf", "go2.xml"),
    ):
        parser.add_argument(f"--{name}", type=Path, default=Path(default))
    files = parser.parse_args()
    for path in vars(files).values():
        if not path.is_file():
            parser.error(f"There is no file {path}; loco-drake export writes it.")
    policy = Policy(files.policy)
    print(f"Largest error in the test vectors: {policy.check():.1e}")
    with np.load(files.plans) as archive:
        plan = dict(archive)
    made_for = json.loads(str(plan["header"]))["robot"]
    if made_for != policy.about["robot"]:
        parser.error(f"The plan is of {made_for}, not of {policy.about['robot']}.")
    robot = Robot(files.mjcf, policy.about["joints"]["names"])
    for name, value in deploy(policy, plan, robot).items():
        print(f"{name}: {value if isinstance(value, bool) else format(value, '.3f')}")


if __name__ == "__main__":
    main()
