"""What an exported policy says of itself is true, and docs/deploy.md says it too."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import torch
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

from loco_drake.control.actor import PRIVILEGED, ActorConfig
from loco_drake.control.actor_file import make_actor as make_network
from loco_drake.control.observation import OBSERVATION_LAYOUT, OBSERVATION_SIZE
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.motion.gaits import GAITS, SOURCES, any_label
from loco_drake.tracking.deployment import FORMULAS, PARTS, deployment

PAGE = Path(__file__).parents[2] / "docs" / "deploy.md"


def make_actor(robot, **config):
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(1)
        labels = ["dog-trot", "horse-walk", "cat-leap"]
        return make_network(ActorConfig(robot=robot, labels=labels, **config))


@pytest.fixture(scope="module", params=ROBOTS)
def about(request):
    robot = get_robot(request.param)
    return json.loads(json.dumps(deployment(make_actor(robot.name), robot)))


def test_parts_are_the_observation(about):
    parts = about["observation"]
    assert [(p["name"], p["size"]) for p in parts] == list(OBSERVATION_LAYOUT)
    ends = [part["start"] + part["size"] for part in parts]
    assert [0, *ends] == [part["start"] for part in parts] + [OBSERVATION_SIZE]
    assert {p["name"]: p["scale"] for p in parts if p["scale"] != 1} == {
        "joint_velocities": 0.1,
        "plan_joint_velocities": 0.1,
    }
    ahead = [part["name"] for part in parts if part["samples"] == [1, 2, 4, 8]]
    # All of the plan but what is of the next sample only.
    assert ahead == [
        name
        for name, _ in OBSERVATION_LAYOUT
        if name.startswith("plan_") and name != "plan_joint_velocities"
    ]


def test_it_marks_what_a_policy_ignores(go2):
    about = deployment(make_actor("go2", privileged=False), go2)
    ignored = [part["name"] for part in about["observation"] if part["ignored"]]
    assert ignored == list(PRIVILEGED)
    assert about["memory"] is None


def test_it_tells_of_a_memory(go2):
    actor = make_actor("go2", privileged=False, history=2)
    about = deployment(actor, go2)
    ignored = [part["name"] for part in about["observation"] if part["ignored"]]
    assert ignored == ["v_WB_H"]
    assert about["memory"]["input"] == {"name": "memory", "shape": ["N", 149]}
    assert about["memory"]["output"]["shape"] == ["N", 149]
    first, *others = about["test_vectors"]
    assert not any(first["memory"])
    for case in (first, *others):
        inputs = (torch.tensor(case[k])[None] for k in ("observation", "memory"))
        with torch.inference_mode():
            results = actor.step(*inputs)
        for name, value in zip(("action", "next_memory"), results, strict=True):
            np.testing.assert_allclose(value[0], case[name], atol=1e-6)
    assert all(case["memory"][0] == 1 for case in others)


@pytest.fixture(scope="module")
def plant_of():
    """Of each robot a plant of its own, which knows nothing of ground or gains."""

    def make(name):
        plant = MultibodyPlant(0.0)
        get_robot(name).AddModel(Parser(plant))
        plant.Finalize()
        return plant, plant.CreateDefaultContext()

    return {name: make(name) for name in ROBOTS}


def feed_forward(about, plant, context, case):
    """Torques by the page's formula, from mass matrix and one least-squares problem."""
    given = about["feed_forward"]
    q0, q1 = case["plan_q_now"], case["plan_q"][0]
    v0, v1 = case["plan_v_now"], case["plan_v"][0]
    q, v = (q0 + q1) / 2, (v0 + v1) / 2
    q[:4] /= np.linalg.norm(q[:4])
    vdot = (v1 - v0) / about["network"]["period_s"]
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    M = plant.CalcMassMatrix(context)
    needed = M @ vdot + plant.CalcBiasTerm(context)
    needed -= plant.CalcGravityGeneralizedForces(context)
    world, standing = plant.world_frame(), case["plan_contacts"][0].astype(bool)
    J = np.vstack(
        [
            plant.CalcJacobianTranslationalVelocity(
                context,
                JacobianWrtVariable.kV,
                plant.GetFrameByName(f"{leg}_foot"),
                np.zeros(3),
                world,
                world,
            )
            for leg, stands in zip(about["legs"], standing, strict=True)
            if stands
        ]
        or [np.zeros((0, 18))]
    )
    count = len(J) // 3
    load = given["mass_kg"] * max(0, given["g_mps2"] + vdot[5])
    f0 = np.tile([0.0, 0.0, load / max(count, 1)], count)
    w = np.repeat([given["moment_weight_per_m"], 1.0], 3)
    rows = np.vstack(
        (w[:, None] * J[:, :6].T, given["damping"] ** 0.5 * np.eye(len(J)))
    )
    wanted = np.concatenate((w * needed[:6], given["damping"] ** 0.5 * f0))
    f = np.linalg.lstsq(rows, wanted)[0].reshape(count, 3)
    weight = given["mass_kg"] * given["g_mps2"]
    f[:, 2] = np.clip(f[:, 2], 0, given["max_load"] * weight)
    for force in f:
        along = np.hypot(*force[:2])
        if along > given["friction"] * force[2]:
            force[:2] *= given["friction"] * force[2] / along
    return needed[6:] - J[:, 6:].T @ f.ravel()


def test_set_points_follow_from_the_formulas(about, plant_of):
    """And targets from set-points and actions, in five cases that differ."""
    cases = about["test_vectors"]
    assert len(cases) == 5
    kp = np.array(about["pd"]["kp_nm_per_rad"])
    gain = np.array(about["feed_forward"]["velocity_gain_nms_per_rad"])
    scale = about["action"]["scale_rad"]
    for case in cases:
        case = {k: np.array(x) for k, x in case.items()}
        v = (case["plan_v_now"] + case["plan_v"][0])[6:] / 2
        tau = feed_forward(about, *plant_of[about["robot"]], case)
        expected = case["plan_q"][0][7:] + (gain * v + tau) / kp
        np.testing.assert_allclose(case["set_points"], expected, atol=1e-6)
        target = case["set_points"] + scale * case["action"]
        np.testing.assert_allclose(case["target"], target, atol=1e-12)
    # Among them are plans that speed up and slow down, and both signs of a quaternion.
    up = [case["plan_v"][0][5] - case["plan_v_now"][5] for case in cases]
    assert max(up) > 0 > min(up)
    signs = {np.sign(np.dot(c["q"][:4], c["plan_q"][0][:4])) for c in cases}
    assert signs == {-1, 1}


def test_labels_are_coded_as_it_says(about):
    sources, gaits = about["label"]["sources"], about["label"]["gaits"]
    labels = [case["label"] for case in about["test_vectors"]]
    assert labels[:4] == ["dog-trot", "horse-walk", "cat-leap", "dog-trot"]
    for case in about["test_vectors"]:
        label = any_label(case["label"])
        code = [float(label.source == s) for s in sources]
        code += [float(label.gait == g) for g in gaits]
        assert case["observation"][-12:] == code


def test_gains_and_limits_are_those_of_the_motors(go2):
    """100 Nm/rad and 3 Nm s/rad, of which a step of 10 ms of Drake's is a third."""
    about = deployment(make_actor("go2"), go2)
    assert about["pd"]["kp_nm_per_rad"] == [100.0] * 12
    assert about["pd"]["kd_nms_per_rad"] == [3.0] * 12
    assert about["pd"]["drake"] == {"step_s": 0.01, "kd_nms_per_rad": [2.0] * 12}
    assert about["feed_forward"]["velocity_gain_nms_per_rad"] == [2.0] * 12
    assert about["network"]["period_s"] == 0.02
    effort = about["joints"]["effort_nm"]
    assert effort == pytest.approx([23.7, 23.7, 35.55] * 4)
    assert about["fallen"]["tilt_rad"] == pytest.approx(np.pi / 3)


def test_the_page_defines_the_parts_with_the_same_words():
    section = PAGE.read_text().split("## Observation\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \|(.*)\|$", section, re.M)
    table = {name: [cell.strip() for cell in row.split("|")] for name, row in rows}
    start = 0
    for name, size in OBSERVATION_LAYOUT:
        part = PARTS[name]
        scale = f"{part.scale:g}"
        places = f"{start} to {start + size - 1}" if size > 1 else str(start)
        samples = {"now": "", "next": "n + 1", "ahead": "n + 1, 2, 4, 8"}[part.samples]
        row = [places, f"`{part.formula}`", samples, part.unit, part.frame, scale]
        assert table[name] == row
        start += size
    text = " ".join(PAGE.read_text().split())
    for formula in FORMULAS.values():
        assert f"`{formula}`" in text
    sources, gaits = ", ".join(SOURCES), ", ".join(GAITS)
    assert f"1 for the source: {sources}." in text
    assert f"1 for the gait: {gaits}." in text
