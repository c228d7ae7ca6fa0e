"""Folders of trainings: the same rules for all four ``train`` commands."""

import json
import resource
import shutil
import subprocess
import sys

import pytest

from loco_drake.cli.main import main
from loco_drake.common.run_folder import open_run, read_checkpoint
from loco_drake.motion.motion_file import save_motion
from tests.synthetic_motion import synthetic_motion

pytestmark = pytest.mark.slow

KINDS = ("tokenizer", "generator", "tracker", "classifier")
CHECKPOINT = "checkpoint.safetensors"
# An option of each that the run has otherwise, and what is said of it.
CONTRADICTIONS = {
    "tokenizer": ("--learning-rate 0.5", "--learning-rate 0.002, not 0.5;"),
    "generator": ("--books 3 --seed 7", "--seed 0, not 7, and --books 2, not 3;"),
    "tracker": (
        "--robot a1 --termination.position 2",
        "--robot go2, not a1, and --termination.position 0.35, not 2.0;",
    ),
    "classifier": ("--weight-decay 0.5", "--weight-decay 0.01, not 0.5;"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with motions, and a run of a few steps of each kind."""
    folder = tmp_path_factory.mktemp("made")
    for label in ("dog-trot", "dog-pace"):
        save_motion(synthetic_motion(label, 3.0, 0.6), folder / "m" / f"{label}.npz")
    tokenizer = f"--tokenizer {folder}/tokenizer/tokenizer.safetensors"
    own = {
        "tokenizer": f"--motions {folder}/m --steps 1",
        "generator": f"--motions {folder}/m {tokenizer} --books 2 --stitched 1 "
        "--steps 1",
        "tracker": f"--motions {folder}/m --workers 1 --per-worker 2 --batch 64 "
        "--steps 64",
        "classifier": f"--motions {folder}/m --steps 1",
    }
    for kind, options in own.items():
        assert train(kind, folder / kind, options) == 0
    return folder, own


@pytest.fixture
def run_of(made, tmp_path):
    """Copies the run of a kind to a folder of the test."""
    return lambda kind: shutil.copytree(made[0] / kind, tmp_path / kind)


def train(kind, out, options=""):
    return main(["train", kind, "--out", str(out), *options.split()])


def contents(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in files}


def refused(capsys, status):
    """Returns what is said of a refusal: one sentence."""
    error = capsys.readouterr().err.strip()
    assert status == 2
    assert error.startswith("loco-drake: ")
    assert len(error.splitlines()) == 1
    return error


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_is_never_overwritten(kind, made, run_of, capsys):
    """Without --resume nothing in its folder is touched, and both ways out are said."""
    out = run_of(kind)
    before = contents(out)
    for left in (list(before), [path for path in before if path.name != CHECKPOINT]):
        for path in out.glob("*"):
            if path.is_file() and path not in left:
                path.unlink()
        error = refused(capsys, train(kind, out, made[1][kind]))
        assert "--resume" in error
        assert "--out" in error
        assert contents(out) == {path: before[path] for path in left}


@pytest.mark.parametrize("kind", KINDS)
def test_options_that_contradict_the_run_are_named_with_both_values(
    kind, run_of, capsys
):
    out = run_of(kind)
    before = contents(out)
    options, said = CONTRADICTIONS[kind]
    assert said in refused(capsys, train(kind, out, f"--resume {options}"))
    assert contents(out) == before


@pytest.mark.parametrize("kind", KINDS)
def test_options_that_are_not_given_are_those_of_the_run(kind, run_of):
    """With nothing but more steps: done, and the checkpoint is of the same run."""
    out = run_of(kind)
    before = read_checkpoint(out / CHECKPOINT, kind)
    steps = 2 * before.state["steps"]
    assert train(kind, out, f"--resume --steps {steps} --json {out}/f.json") == 0
    after = read_checkpoint(out / CHECKPOINT, kind)
    assert after.state["steps"] == steps
    assert json.loads((out / "f.json").read_text())["steps"] == steps
    assert after.run == before.run
    assert after.options == {
        **before.options,
        "steps": steps,
        "out": str(out),
        "json": f"{out}/f.json",
        "resume": True,
    }


@pytest.mark.parametrize("kind", KINDS)
def test_only_a_run_of_the_same_kind_can_be_resumed(kind, run_of, tmp_path, capsys):
    other = KINDS[KINDS.index(kind) - 1]
    error = refused(capsys, train(kind, run_of(other), "--resume"))
    assert f"{other} checkpoint" in error
    assert f"{kind} checkpoint" in error
    (tmp_path / "empty").mkdir()
    for out in (tmp_path / "empty", tmp_path / "none"):
        error = refused(capsys, train(kind, out, "--resume"))
        assert "no run to resume" in error
    assert not (tmp_path / "none").exists()
    assert not list((tmp_path / "empty").iterdir())


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_checkpoint_is_refused_and_left_alone(kind, run_of, capsys):
    out = run_of(kind)
    path = out / CHECKPOINT
    whole = path.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"\0" * 5000, b"{" + whole):
        path.write_bytes(damaged)
        assert CHECKPOINT in refused(capsys, train(kind, out, "--resume"))
        assert path.read_bytes() == damaged


def test_fewer_steps_than_were_done_are_refused(run_of, capsys):
    error = refused(capsys, train("tracker", run_of("tracker"), "--resume --steps 9"))
    assert "has done 64 steps, more than --steps 9." in error


def test_other_motions_than_those_of_the_run_are_refused(
    made, run_of, tmp_path, capsys
):
    """Whatever the folder is called: it is its motions that must be the same."""
    moved = shutil.copytree(made[0] / "m", tmp_path / "moved")
    out = run_of("tokenizer")
    options = f"--resume --steps 2 --motions {moved}"
    assert train("tokenizer", out, options) == 0
    capsys.readouterr()
    save_motion(synthetic_motion("dog-trot", 2.0, 0.4), moved / "another.npz")
    error = refused(capsys, train("tokenizer", out, options))
    assert "motions 4 clips of 604 frames, not 6 clips of 806 frames" in error


@pytest.mark.parametrize("kind", KINDS)
def test_two_trainings_in_one_folder_are_refused(kind, run_of, capsys):
    out = run_of(kind)
    saved = read_checkpoint(out / CHECKPOINT, kind)
    steps = saved.state["steps"]
    with open_run(out, kind, "x", saved.run, steps=steps, resume=True, options={}):
        before = contents(out)
        error = refused(capsys, train(kind, out, f"--resume --steps {2 * steps}"))
        assert "Another training is at work" in error
        assert contents(out) == before
    assert train(kind, out, "--resume") == 0


@pytest.mark.parametrize("kind", ["tokenizer", "tracker"])
def test_a_full_disk_ends_training_in_one_sentence(kind, run_of):
    """What cannot be written replaces nothing, and leaves nothing behind."""
    out = run_of(kind)
    before = (out / CHECKPOINT).read_bytes()
    steps = {"tokenizer": 16, "tracker": 256}[kind]
    script = (
        "import resource; from loco_drake.cli.main import main\n"
        "if __name__ == '__main__':\n"
        f"    resource.setrlimit(resource.RLIMIT_FSIZE, ({len(before) // 2},) * 2)\n"
        f"    raise SystemExit(main(['train', '{kind}', '--resume', '--out', "
        f"'{out}', '--steps', '{steps}']))"
    )
    (out / "main.py").write_text(script)
    ended = subprocess.run(
        [sys.executable, str(out / "main.py")],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ended.returncode == 1, ended.stderr
    assert "Traceback" not in ended.stderr
    assert "File too large" in ended.stderr
    assert (out / CHECKPOINT).read_bytes() == before
    assert not list(out.glob(".*"))
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY
