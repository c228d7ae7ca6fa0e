"""Weights of one's own training in simulations and drives."""

import json
import shutil

import pytest

from loco_drake.cli.main import main
from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_network
from loco_drake.models.shipped import weights_in
from loco_drake.motion.motion_file import load_motion
from tests.tiny_model import make_tiny_model

TINY = ("tokenizer", "generator")


@pytest.fixture(scope="module")
def runs(weights, tmp_path_factory):
    """A folder with a run of each kind, as the trainings leave them."""
    folder, model = tmp_path_factory.mktemp("runs"), make_tiny_model()
    for kind in TINY:
        (folder / kind).mkdir()
        path = folder / kind / f"{kind}.safetensors"
        save_network(path, kind, getattr(model, kind), {"labels": ["dog-trot"]})
    (folder / "tracker").mkdir()
    shutil.copy(weights / "calm.safetensors", folder / "tracker" / "policy.safetensors")
    return folder


def run(command, path, *arguments):
    """Runs a command; returns its figures."""
    assert main([command, *map(str, arguments), "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    return {k: v for k, v in figures.items() if k != "real_time_factor"}


def test_weights_are_found_in_a_run_and_in_a_folder_of_runs(runs, tmp_path):
    found = weights_in(runs)
    places = {kind: path.parent.name for kind, path in found.items()}
    assert places == {
        "tokenizer": "tokenizer",
        "generator": "generator",
        "policy": "tracker",
    }
    assert weights_in(runs / "tracker") == {"policy": found["policy"]}
    shutil.copytree(runs, tmp_path / "runs")
    shutil.copytree(runs / "tracker", tmp_path / "runs" / "again")
    with pytest.raises(InputError, match=r"Several runs .* a policy: .*again, .*track"):
        weights_in(tmp_path / "runs")
    with pytest.raises(InputError, match="no weights in"):
        weights_in(tmp_path)


def test_a_simulation_takes_all_weights_of_a_folder(runs, tmp_path):
    """The same as one by one, in a scenario, too; the shipped ones move otherwise."""
    path, line = tmp_path / "a.json", ("--no-meshcat", "--duration", 0.5)
    whole = run("simulate", path, *line, "--weights", runs)
    files = weights_in(runs)
    single = [x for kind, file in files.items() for x in (f"--{kind}", file)]
    assert run("simulate", path, *line, *single) == whole
    reference = ", ".join(f"{kind}: {files[kind]}" for kind in TINY)
    scenario = f"reference: !GeneratedReference {{{reference}}}"
    policy = ("--policy", files["policy"])
    assert run("simulate", path, *line, *policy, "--overlay", scenario) == whole
    shipped = run("simulate", path, *line, *policy)
    assert shipped["joint_rmse_rad"] != whole["joint_rmse_rad"]


def test_a_tokenizer_of_another_generator_is_refused(runs, tmp_path, capsys):
    own = runs / "tokenizer" / "tokenizer.safetensors"
    assert main(["simulate", "--no-meshcat", "--tokenizer", str(own)]) == 2
    assert "train the generator again" in capsys.readouterr().err
    line = ["simulate", "--no-meshcat", "--reference", str(tmp_path / "a.npz")]
    (tmp_path / "a.npz").touch()
    assert main([*line, "--tokenizer", str(own)]) == 2
    assert "the reference is a file" in capsys.readouterr().err


def test_a_recorded_drive_knows_its_weights(runs, tmp_path, capsys):
    """It repeats with those of the folder, and is refused when they are others."""
    shutil.copytree(runs, tmp_path / "runs")
    drive, path = tmp_path / "a.drive", tmp_path / "a.json"
    table = tmp_path / "commands.csv"
    table.write_text("time,forward,sideways,yaw_rate\n0,0.3,0,0\n")
    line = ("--no-meshcat", "--duration", 0.4)
    orders = ("--gait", "dog-trot", "--commands", table)
    run(
        "drive", path, *line, *orders, "--weights", tmp_path / "runs", "--record", drive
    )
    again = run("drive", path, *line, "--replay", drive)
    assert again["identical"]
    other, file = (
        make_tiny_model(told=True).generator,
        "generator/generator.safetensors",
    )
    save_network(tmp_path / "runs" / file, "generator", other, {})
    assert main(["drive", "--no-meshcat", "--replay", str(drive)]) == 2
    error = capsys.readouterr().err
    assert "not those of the recorded drive; name these with --generator" in error


def test_motion_is_generated_with_the_weights_of_a_folder(runs, tmp_path):
    files = weights_in(runs)
    line = ["generate", "--gait", "dog-trot", "--duration", "0.2", "--out"]
    single = [x for kind in TINY for x in (f"--{kind}", str(files[kind]))]
    for name, options in (("a", ["--weights", str(runs)]), ("b", single), ("c", [])):
        assert main([*line, str(tmp_path / name), *options]) == 0
    first, second, shipped = (
        load_motion(tmp_path / name / "dog-trot-0.npz").joint_positions
        for name in ("a", "b", "c")
    )
    assert (first == second).all()
    assert not (first == shipped).all()
