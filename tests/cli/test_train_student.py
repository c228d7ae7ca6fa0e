import json

import pytest

from loco_drake.cli.main import main
from loco_drake.common.run_folder import read_checkpoint
from loco_drake.control.actor_file import load_actor
from loco_drake.models.robots import get_robot
from loco_drake.tracking.randomization import STANDARD


def train(references, *options):
    return main(["train", "student", "--motions", str(references), *options])


@pytest.mark.slow
def test_options_reach_the_training(references, tmp_path, capsys):
    """One batch in randomized worlds, of a student that remembers two measurements."""
    options = "--steps 64 --batch 64 --minibatch 32 --updates 2 --workers 1 --history 2"
    options += " --randomize --randomization.payload 2 2 --json"
    out = tmp_path / "run"
    arguments = [*options.split(), str(tmp_path / "figures.json"), "--out", str(out)]
    assert train(references, *arguments) == 0
    assert json.loads((tmp_path / "figures.json").read_text())["steps"] == 64
    config = load_actor(out / "policy.safetensors", get_robot("go2")).config
    assert (config.privileged, config.history) == (False, 2)
    run = read_checkpoint(out / "checkpoint.safetensors", "student").run
    assert run["randomization.payload"] == [2.0, 2.0]
    assert run["randomization.latency"] == list(STANDARD.latency)
    capsys.readouterr()
    # The options of the run need not be given again.
    assert main(["train", "student", "--resume", "--out", str(out)]) == 0
    assert train(references, "--resume", "--history", "3", "--out", str(out)) == 2
    assert "has --history 2, not 3;" in capsys.readouterr().err
    other = ["--resume", "--steps", "128", "--teacher", str(out / "policy.safetensors")]
    assert train(references, *other, "--out", str(out)) == 2
    assert "cannot teach" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--teacher nobody", "or a shipped policy: a1,"),
        ("--teacher a1", "for another robot: a1, not go2"),
        ("--robot a1 --teacher a1_unprivileged", "is of go2, not of a1"),
        ("--history 0", "--history must be 1 or more"),
        ("--handover 2", "--handover must be 0 or more and at most 1"),
        ("--batch 8", "--batch must be at least 32"),
        ("--capacity 100", "--capacity must be 4096 or more"),
        ("--robot spot", "the choices are go2, a1"),
        ("--resume", "There is no run to resume"),
    ],
)
def test_bad_options_are_one_sentence(references, tmp_path, options, message, capsys):
    out = tmp_path / "run"
    assert train(references, *options.split(), "--out", str(out)) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    assert not out.exists()
