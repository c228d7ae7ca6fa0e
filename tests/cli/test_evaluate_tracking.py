import json
import sys

import pytest

from loco_drake.cli.main import main

KEYS = {
    "normalized_return",
    "fall_rate",
    "joint_rmse_rad",
    "base_position_rmse_m",
    "base_orientation_rmse_rad",
    "stance_slip_median_mps",
    "stretch",
}


def test_json_has_the_agreed_shape(tmp_path, capsys):
    path = tmp_path / "figures.json"
    options = ["--labels", "dog-pace", "dog-trot", "--seeds", "2", "--duration", ".4"]
    assert main(["evaluate", "tracking", *options, "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    assert (figures["robot"], figures["contact"]) == ("go2", "similar")
    assert figures["reference"] == "generated"
    assert list(figures["labels"]) == ["dog-pace", "dog-trot"]
    for row in (*figures["labels"].values(), figures["all"]):
        assert set(row) >= KEYS
    assert figures["all"]["episodes"] == 4
    assert figures["real_time_factor"] > 0
    assert "all of these" in capsys.readouterr().out


def test_json_says_what_the_worlds_were_drawn_from(tmp_path, capsys):
    path = tmp_path / "figures.json"
    options = "--labels dog-pace --seeds 1 --duration .2 --pushes --push-interval .1"
    options += " --friction .5 --randomization.payload 1 2 --json"
    assert main(["evaluate", "tracking", *options.split(), str(path)]) == 0
    figures = json.loads(path.read_text())
    assert figures["friction"] == 0.5
    randomization = figures["randomization"]
    assert randomization["push"] == [1.0, 1.0]
    assert randomization["push_interval"] == [0.1, 0.1]
    assert randomization["payload"] == [1.0, 2.0]
    assert randomization["friction"] is randomization["noise"] is None
    assert "similar, randomized" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--pushes --push-size -1", "push must be two numbers"),
        ("--pushes --push-interval 0", "push_interval must be two numbers"),
        ("--randomization.latency 0 1", "latency must be two numbers"),
        ("--robot spot", "choices are go2, a1, all"),
        ("--reference dog", "choices are generated, retargeted, grounded"),
        ("--labels dog-hop", "Unknown gait 'dog-hop'"),
        ("--seeds 0", "--seeds must be 1 or more"),
        ("--duration nan", "duration must be above 0"),
        ("--contact glue", "choices are similar, lagged, sap, cenic"),
        ("--time-step 0", "time_step must be a number from 1e-05 to 0.05"),
        ("--workers 0", "--workers must be 1 or more"),
        ("--policy nowhere.safetensors", "nowhere.safetensors"),
        ("--reference retargeted --data-dir nowhere", "no data folder"),
    ],
)
def test_bad_options_are_one_sentence(options, message, capsys):
    assert main(["evaluate", "tracking", *options.split()]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1


def test_recordings_of_any_label_can_be_followed(made_data, tmp_path, capsys):
    """Not only of the fifteen; of a label without recordings the choices are named."""
    (tmp_path / "dog_mann").symlink_to(made_data / "dog_mann")
    turn = "dog_mann,keypoints/made_pace.txt,turn_left,0,200,60,1,\n"
    table = (made_data / "segments.csv").read_text() + turn
    (tmp_path / "segments.csv").write_text(table)
    path = tmp_path / "figures.json"
    options = (
        f"--reference retargeted --data-dir {tmp_path} --duration .1 --json {path}"
    )
    line = ["evaluate", "tracking", *options.split(), "--labels"]
    assert main([*line, "dog-turn_left"]) == 0
    figures = json.loads(path.read_text())
    assert list(figures["labels"]) == ["dog-turn_left"]
    grounded = [x.replace("retargeted", "grounded") for x in line]
    assert main([*grounded, "dog-turn_left"]) == 0
    moved = json.loads(path.read_text())
    assert moved["reference"] == "grounded"
    # The motion is another one.
    assert moved["all"] != figures["all"]
    assert main([*line, "dog-hop"]) == 2
    assert "'dog-hop'; the choices are dog-pace" in capsys.readouterr().err


def test_mujoco_gives_the_same_figures(tmp_path, capsys):
    """Under the same keys; a model written by export is taken as somebody else's."""
    pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    model, path = tmp_path / "go2.xml", tmp_path / "figures.json"
    assert main(["export", "--mjcf", str(model)]) == 0
    assert not list(tmp_path.glob("*.onnx"))
    line = "evaluate tracking --simulator mujoco --labels dog-pace --seeds 1"
    line += f" --duration .4 --json {path}"
    results = []
    for more in ([], ["--mujoco-model", str(model)]):
        assert main([*line.split(), *more]) == 0
        results.append(json.loads(path.read_text()))
    first, second = results
    assert (first["simulator"], first["time_step_s"]) == ("mujoco", 0.002)
    assert (first["mjcf"], second["mjcf"]) == (None, "go2.xml")
    assert first["labels"] == second["labels"]
    assert set(first["all"]) >= KEYS
    assert first["all"]["normalized_return"] > 80
    assert "go2, generated, mujoco" in capsys.readouterr().out


def test_recordings_can_be_followed_in_mujoco(made_data, tmp_path):
    pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    path = tmp_path / "figures.json"
    line = "evaluate tracking --simulator mujoco --reference retargeted --seeds 1"
    line += f" --labels dog-trot --duration .4 --data-dir {made_data} --json {path}"
    assert main(line.split()) == 0
    figures = json.loads(path.read_text())
    assert figures["reference"] == "retargeted"
    assert figures["all"]["normalized_return"] > 70


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--simulator gazebo", "choices are drake, mujoco"),
        ("--mujoco-model a.xml", "add --simulator mujoco"),
        ("--simulator mujoco --pushes", "cannot be used with --simulator mujoco"),
        ("--simulator mujoco --contact sap", "cannot be used with --simulator mujoco"),
        ("--simulator mujoco --mujoco-model nowhere.xml", "no MJCF file 'nowhere.xml'"),
        ("--simulator mujoco --time-step .02", "time_step must be a number from"),
        ("--simulator mujoco --time-step .003", "must divide 0.02 s, as 0.002 does"),
        ("--time-step .04", "time_step must be at most 0.03 s for go2, not 0.04"),
    ],
)
def test_options_of_the_other_simulator_are_refused(options, message, capsys):
    pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    assert main(["evaluate", "tracking", *options.split()]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1


def test_without_mujoco_one_sentence_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert main(["evaluate", "tracking", "--simulator", "mujoco"]) == 2
    assert capsys.readouterr().err == (
        "loco-drake: To simulate in MuJoCo, install the package mujoco, the extra "
        "'mujoco' of loco_drake.\n"
    )
