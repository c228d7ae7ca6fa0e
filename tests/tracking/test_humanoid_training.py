"""A tracker of the G1: trained, resumed, simulated and evaluated by the commands."""

import json

import numpy as np
import pytest
import torch

from loco_drake.cli.main import main
from loco_drake.common.errors import InputError
from loco_drake.common.run_folder import read_checkpoint
from loco_drake.control.actor_file import load_actor
from loco_drake.models.robots import get_simulated
from loco_drake.models.shipped import pretrained_path
from loco_drake.motion.motion_file import save_motion
from loco_drake.tracking.config import EnvironmentConfig
from loco_drake.tracking.environment import make_tracking
from tests.humanoid_motion import march_plan, marching

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("g1")
    save_motion(marching(), folder / "motions" / "march.npz")
    return folder


@pytest.fixture(scope="module")
def policy(folder):
    """Of one batch, and of another after it."""
    out = folder / "run"
    line = f"train tracker --robot g1 --motions {folder / 'motions'} --out {out}"
    small = "--workers 1 --per-worker 2 --batch 32 --minibatch 16 --hidden 16"
    assert main([*line.split(), *small.split(), "--steps", "32"]) == 0
    first = read_checkpoint(out / "checkpoint.safetensors", "tracker")
    assert main([*line.split(), "--resume", "--steps", "64"]) == 0
    second = read_checkpoint(out / "checkpoint.safetensors", "tracker")
    assert (first.state["steps"], second.state["steps"]) == (32, 64)
    name = next(k for k in first.tensors if k.endswith("action_net.weight"))
    assert first.tensors[name].shape == (29, 16)
    assert not (first.tensors[name] == second.tensors[name]).all()
    return out / "policy.safetensors"


def test_training_makes_a_policy_of_its_joints(policy):
    actor = load_actor(policy, get_simulated("g1"))
    assert actor.config.labels == ["other-other"]
    assert actor.layers[-1].out_features == 29


def test_the_shipped_policy_is_the_humanoids():
    """Of its 29 joints; the robots with twelve refuse it."""
    actor = load_actor(pretrained_path("policy_g1"), get_simulated("g1"))
    assert actor.config.labels == ["other-walk"]
    assert actor(torch.zeros(actor.layout.size)).shape == (29,)
    with pytest.raises(InputError, match="g1"):
        load_actor(pretrained_path("policy_g1"), get_simulated("go2"))


def test_its_plans_are_the_motion_at_its_own_time(folder):
    env = make_tracking(EnvironmentConfig(robot="g1"), references=folder / "motions")
    (plan,) = env.plans
    np.testing.assert_array_equal(plan.q, march_plan().q)
    np.testing.assert_allclose(np.diff(plan.path_time), 0.02)


def test_it_is_simulated_and_evaluated_with_its_motion(folder, policy, capsys):
    motion, path = folder / "motions" / "march.npz", folder / "a.json"
    given = ["--robot", "g1", "--reference", str(motion), "--policy", str(policy)]
    line = ["simulate", *given, "--duration", ".3", "--no-meshcat"]
    assert main([*line, "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    assert (figures["gait"], figures["fell"]) == ("human-march", False)
    assert figures["normalized_return"] > 50
    html = folder / "a.html"
    assert main([*line, "--html", str(html)]) == 0
    assert html.stat().st_size > 1e5
    line = ["evaluate", "tracking", *given, "--seeds", "2", "--duration", ".3"]
    assert main([*line, "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    assert figures["all"]["episodes"] == 2
    assert figures["survived_s"] == [0.3, 0.3]
    assert figures["labels"]["human-march"]["fall_rate"] == 0
    assert "human-march" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("train tracker --robot g1 --motions {0} --randomize", "leave out --randomize"),
        ("train tracker --robot g1 --motions {0} --start-from go2", "another obs"),
        ("train tracker --robot go2 --motions {0}", "is of g1, not of go2"),
        (
            "train tracker --robot g1 --motions {0} --plant.time-step .02",
            "at most 0.01",
        ),
        ("simulate --robot g1 --no-meshcat", "g1 follows a Motion file"),
        (
            "simulate --robot g1 --no-meshcat --reference {1} --policy unprivileged",
            "there is only the main one",
        ),
        (
            "simulate --robot g1 --no-meshcat --reference {1} --command 1 0 0",
            "--command is for robots with three joints a leg",
        ),
        ("evaluate tracking --robot g1", "A humanoid tracks Motion files"),
        ("evaluate tracking --robot go2 --reference {1}", "is of g1, not of go2"),
        ("export --robot g1 --out a.onnx", "Unknown robot 'g1'"),
    ],
)
def test_what_cannot_be_is_refused(folder, tmp_path, monkeypatch, capsys, line, reason):
    monkeypatch.chdir(tmp_path)
    motions = folder / "motions"
    given = line.format(motions, motions / "march.npz").split()
    assert main(given) == 2
    assert reason in " ".join(capsys.readouterr().err.split())
