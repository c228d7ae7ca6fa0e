"""The list of trainings."""

import json

import torch

from loco_drake.cli.main import main
from loco_drake.common.run_folder import CHECKPOINT, open_run


def training(folder, name, steps, *, planned=100, inside=lambda: None):
    """Leaves a run with a checkpoint at ``steps``; ``inside`` is called in its lock."""
    options = {"steps": planned, "seed": 0}
    with open_run(
        folder, name, "x", {"seed": 0}, steps=planned, resume=False, options=options
    ) as run:
        run.save({"weight": torch.ones(3)}, {"steps": steps})
        inside()


def listed(folder, path):
    assert main(["runs", "list", str(folder), "--json", str(path)]) == 0
    return {run["name"]: run for run in json.loads(path.read_text())["runs"]}


def test_trainings_are_listed_with_how_far_they_are(tmp_path, capsys):
    runs, path, seen = tmp_path / "runs", tmp_path / "figures.json", {}
    training(runs / "mine" / "tokenizer", "tokenizer", 100)
    training(runs / "trot", "tracker", 40)
    lines = [
        {"steps": 20, "seconds": 1, "return/dog-trot": 10, "return/dog-pace": None},
        {"steps": 40, "seconds": 2, "return/dog-trot": 50, "return/dog-pace": 30},
    ]
    log = "".join(f"{json.dumps(line)}\n" for line in lines)
    (runs / "trot" / "progress.jsonl").write_text(log)
    training(
        runs / "busy", "student", 1, inside=lambda: seen.update(listed(runs, path))
    )
    assert {name: run["state"] for name, run in seen.items()} == {
        "busy": "at work",
        "mine/tokenizer": "ended",
        "trot": "interrupted",
    }
    trot = listed(runs, path)["trot"]
    assert (trot["training"], trot["steps"], trot["of_steps"]) == ("tracker", 40, 100)
    assert trot["return"] == 40.0
    assert seen["mine/tokenizer"]["return"] is None
    assert "40 of 100" in capsys.readouterr().out


def test_what_is_no_run_is_passed_over_and_damage_is_told(tmp_path, capsys):
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / CHECKPOINT).write_text("no weights")
    assert listed(tmp_path, tmp_path / "a.json") == {}
    assert "There are no runs" in capsys.readouterr().err
    training(tmp_path / "run", "tracker", 40)
    file = tmp_path / "run" / CHECKPOINT
    content = bytearray(file.read_bytes())
    content[-1] ^= 64
    file.write_bytes(content)
    assert listed(tmp_path, tmp_path / "a.json") == {}
    assert "does not match its hash" in capsys.readouterr().err
    assert main(["runs", "list", str(tmp_path / "nowhere")]) == 2
    assert "no folder" in capsys.readouterr().err
