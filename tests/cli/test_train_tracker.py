import json

import pytest
import torch

from loco_drake.cli.main import main
from loco_drake.common.run_folder import read_checkpoint
from loco_drake.control.actor_file import load_actor
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.tracking.randomization import STANDARD


def train(references, *options):
    return main(["train", "tracker", "--motions", str(references), *options])


@pytest.mark.slow
def test_options_reach_the_training(references, tmp_path, capsys):
    """One batch in randomized worlds, of a policy without privileged observations."""
    options = (
        "--steps 64 --batch 64 --workers 1 --randomize --randomization.payload 2 2"
    )
    options += " --no-privileged --json"
    out = tmp_path / "run"
    arguments = [*options.split(), str(tmp_path / "figures.json"), "--out", str(out)]
    assert train(references, *arguments) == 0
    assert json.loads((tmp_path / "figures.json").read_text())["steps"] == 64
    assert not load_actor(
        out / "policy.safetensors", get_robot("go2")
    ).config.privileged
    run = read_checkpoint(out / "checkpoint.safetensors", "tracker").run
    assert run["randomization.payload"] == [2.0, 2.0]
    assert run["randomization.latency"] == list(STANDARD.latency)
    capsys.readouterr()
    resumed = ["--resume", "--privileged", "--out", str(out)]
    assert train(references, *resumed) == 2
    assert "has --privileged False, not True;" in capsys.readouterr().err


@pytest.mark.slow
def test_a_shipped_policy_can_be_started_from(references, tmp_path):
    """The A1's for a Go2: five steps of Adam at its learning rate hardly change it."""
    options = "--start-from a1 --steps 64 --batch 64 --workers 1"
    out = tmp_path / "run"
    assert train(references, *options.split(), "--out", str(out)) == 0
    a1, go2 = get_robot("a1"), get_robot("go2")
    shipped = load_actor(pretrained_path("policy_a1"), a1)
    learned = load_actor(out / "policy.safetensors", go2)
    with torch.no_grad():
        for old, new in zip(
            shipped.layers.parameters(), learned.layers.parameters(), strict=True
        ):
            assert 0 < (old - new).abs().max() < 2e-3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--randomization.friction 1.2 .4", "friction must be two numbers"),
        ("--randomization.noise -1", "noise must be 0 or more"),
        ("--start-from nowhere.safetensors", "nowhere.safetensors"),
        ("--start-from go3", "or a shipped policy: a1,"),
        ("--start-from x.safetensors --resume", "not both"),
    ],
)
def test_bad_options_are_one_sentence(references, tmp_path, options, message, capsys):
    out = tmp_path / "run"
    assert train(references, *options.split(), "--out", str(out)) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    assert not out.exists()
