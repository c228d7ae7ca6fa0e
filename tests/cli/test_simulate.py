import json
import re
import socket

import numpy as np
import pytest

from loco_drake.cli import simulate as command
from loco_drake.cli.main import main
from loco_drake.control.gait_choice import best_gait
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion_file import save_motion
from loco_drake.systems.gait_selector import measured_gaits
from tests.meshcat_messages import captions
from tests.synthetic_motion import synthetic_motion
from tests.viewing.pictures import (
    below_the_caption,
    needs_renderer,
    plan_pixels,
    read_video,
    robot_columns,
)

KEYS = {
    "robot",
    "gait",
    "duration_s",
    "fell",
    "normalized_return",
    "joint_rmse_rad",
    "base_position_rmse_m",
    "base_orientation_rmse_rad",
    "stretch",
    "speed_mps",
    "real_time_factor",
}


def simulate(folder, *arguments):
    """Runs the command; returns its figures."""
    path = folder / "figures.json"
    assert main(["simulate", *map(str, arguments), "--json", str(path)]) == 0
    return json.loads(path.read_text())


def test_json_has_the_agreed_keys_and_the_table_its_units(weights, tmp_path, capsys):
    policy = weights / "calm.safetensors"
    line = ("--duration", 0.5, "--gait", "dog-pace", "--no-meshcat", "--policy", policy)
    figures = simulate(tmp_path, *line)
    assert set(figures) >= KEYS
    assert (figures["robot"], figures["gait"]) == ("go2", "dog-pace")
    assert figures["duration_s"] == figures["simulated_s"] == 0.5
    assert not figures["fell"]
    assert 0 < figures["normalized_return"] < 100
    printed = capsys.readouterr().out
    for row in ("joint rmse +[.0-9]+ +rad", "speed +[-.0-9]+ +m/s"):
        assert re.search(row, printed), printed
    assert f"{figures['normalized_return']:.3f}   of 100" in printed


def test_the_gait_changes_while_it_runs(weights, tmp_path):
    """It is told from a run that keeps the first gait, and that from the start on."""
    policy = weights / "calm.safetensors"
    line = ("--duration", 2, "--no-meshcat", "--policy", policy, "--gait")
    kept = simulate(tmp_path, *line, "dog-pace")
    changed = simulate(tmp_path, *line, "dog-pace,mpc-trot@0.6")
    assert changed["gait"] == "dog-pace,mpc-trot@0.6"
    assert not changed["fell"]
    assert changed["speed_mps"] > 1.15 * kept["speed_mps"]


def test_one_seed_gives_one_outcome_another_seed_another(weights, tmp_path):
    def figures(seed):
        line = ("--duration", 1, "--seed", seed, "--no-meshcat")
        found = simulate(tmp_path, *line, "--policy", weights / "calm.safetensors")
        del found["real_time_factor"], found["seed"]
        return found

    assert figures(1) == figures(1) != figures(2)


@pytest.mark.parametrize("contact", ["cenic", "lagged", "sap"])
def test_other_solvers_can_be_chosen(weights, tmp_path, contact):
    """All see the same robot: it goes about as far in .4 s as with the default."""
    line = ("--duration", 0.4, "--no-meshcat", "--policy", weights / "calm.safetensors")
    default = simulate(tmp_path, *line)
    other = simulate(tmp_path, *line, "--contact", contact)
    assert other["speed_mps"] == pytest.approx(default["speed_mps"], rel=0.1)
    assert other["joint_rmse_rad"] != default["joint_rmse_rad"]


def test_a_fall_is_a_result(weights, tmp_path):
    """Status 0, and the steps that were not made count as lost."""
    policy = weights / "wild.safetensors"
    line = ("--duration", 5, "--no-meshcat", "--policy", policy)
    figures = simulate(tmp_path, *line)
    assert figures["fell"]
    assert figures["simulated_s"] < 5
    assert figures["normalized_return"] < 100 * figures["simulated_s"] / 5


def test_a_motion_file_is_played_for_as_long_as_it_is(weights, tmp_path):
    save_motion(synthetic_motion("dog-pace", seconds=1.0), tmp_path / "a.npz")
    line = ("--reference", tmp_path / "a.npz", "--no-meshcat")
    figures = simulate(tmp_path, *line, "--policy", weights / "calm.safetensors")
    assert figures["gait"] == "dog-pace"
    # The default of 10 s is cut; the smoother may stretch the motion's 1 s a little.
    assert 0.9 <= figures["duration_s"] <= 1.2


def test_port_in_use_and_replay(weights, tmp_path, monkeypatch, capsys):
    """Meshcat takes a free port, and the replay that it saves is of moderate size."""
    monkeypatch.setenv("LOCO_DRAKE_CACHE", str(tmp_path / "cache"))
    policy, page = weights / "calm.safetensors", tmp_path / "replay.html"
    with socket.socket() as taken:
        taken.bind(("", 0))
        taken.listen()
        port = taken.getsockname()[1]
        line = ("--port", port, "--html", page, "--duration", 0.2, "--policy", policy)
        assert simulate(tmp_path, *line)["duration_s"] == 0.2
    printed = capsys.readouterr()
    assert f"Port {port} is in use" in printed.err
    assert "http://localhost:" in printed.out
    assert str(port) not in printed.out
    assert "<html" in page.read_text()[:1000]
    assert 1e6 < page.stat().st_size < 10e6


def test_a_page_tells_the_gait_and_the_fall_of_its_time(weights, tmp_path):
    page = tmp_path / "a.html"
    line = ("--duration", 5, "--no-meshcat", "--html", page)
    figures = simulate(tmp_path, *line, "--policy", weights / "wild.safetensors")
    told = captions(page.read_text())
    times = [time for time, _ in told]
    assert times[0] == 0
    assert set(np.arange(0.5, figures["simulated_s"], 0.5)) <= set(times)
    for time, caption in told[:-1]:
        for part in ("dog-trot</span>", f"{time:.1f} s  ", " m/s  return ", "plan: "):
            assert part in caption
    assert 0 <= times[-1] - figures["simulated_s"] < 0.03
    assert "it fell</span>" in told[-1][1]


@pytest.mark.parametrize(
    ("options", "terminal", "waited"),
    [("", True, 1), ("", False, 0), ("--no-wait", True, 0), ("--no-meshcat", True, 0)],
)
def test_the_page_stays_if_somebody_is_there(
    options, terminal, waited, weights, tmp_path, monkeypatch
):
    waits = []
    monkeypatch.setattr(command, "in_terminal", lambda: terminal)
    monkeypatch.setattr(
        command, "stay", lambda: waits.append((tmp_path / "figures.json").exists())
    )
    policy = weights / "calm.safetensors"
    simulate(tmp_path, "--duration", 0.1, "--policy", policy, *options.split())
    # With all figures written.
    assert waits == [True] * waited


@needs_renderer
def test_a_video_shows_the_robot_and_its_plan(weights, tmp_path):
    path = tmp_path / "a.webp"
    policy = weights / "calm.safetensors"
    line = ("--no-meshcat", "--duration", 0.4, "--policy", policy, "--video", path)
    assert simulate(tmp_path, *line)["simulated_s"] == 0.4
    pictures, rate = read_video(path)
    assert len(pictures) == 11
    assert rate == pytest.approx(25)
    for picture in pictures[[0, -1]]:
        assert robot_columns(picture).mean() > 0.1
        assert min(plan_pixels(below_the_caption(picture))) > 20


def test_a_video_of_another_format_is_refused_before_the_simulation(tmp_path, capsys):
    line = ["simulate", "--no-meshcat", "--duration", "3600", "--video"]
    assert main([*line, str(tmp_path / "a.avi")]) == 2
    assert "named *.mp4, *.webp, *.gif, not 'a.avi'" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["go2", "a1"])
@pytest.mark.parametrize("gait", ["dog-pace", "dog-trot"])
def test_shipped_weights_carry_the_robots_for_ten_seconds(gait, robot, tmp_path):
    line = ("--robot", robot, "--gait", gait, "--seed", 3, "--no-meshcat")
    figures = simulate(tmp_path, *line)
    assert figures["duration_s"] == figures["simulated_s"] == 10.0
    assert not figures["fell"]
    assert figures["normalized_return"] >= 75
    assert figures["joint_rmse_rad"] <= 0.08
    assert figures["base_position_rmse_m"] <= 0.12
    assert figures["stretch"] <= 1.1


SCENARIO = """
robot: go2
reference: !GeneratedReference {gait: dog-pace, seed: 5, duration: 0.3}
plant: {friction: 0.6}
"""


def test_a_scenario_file_an_overlay_and_options_that_win(weights, tmp_path):
    """The figures are those of the same run, asked for by options."""
    path = tmp_path / "scenario.yaml"
    path.write_text(SCENARIO)
    line = ("--no-meshcat", "--policy", weights / "calm.safetensors")
    options = ("--gait", "dog-pace", "--duration", 0.3, "--friction", 0.5, "--seed", 6)
    expected = simulate(tmp_path, *line, *options)
    overlay = ("--overlay", "plant: {friction: 0.5}", "--seed", 6)
    found = simulate(tmp_path, *line, "--scenario", path, *overlay)
    for figures in (expected, found):
        del figures["real_time_factor"]
    assert found == expected
    assert (found["gait"], found["seed"]) == ("dog-pace", 6)
    # An option of the usual value wins too.
    shorter = simulate(tmp_path, *line, "--scenario", path, "--gait", "dog-trot")
    assert (shorter["gait"], shorter["simulated_s"]) == ("dog-trot", 0.3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scenario", "none.yaml"], "no scenario file 'none.yaml'"),
        (["--scenario", "."], "no scenario file"),
        (["--overlay", "robto: a1"], "cannot be read"),
        (["--overlay", "smoother: {chunk: 0.01}"], "smoother's chunk must be"),
        (["--overlay", "policy: !ExternalAction {}"], "must be trained"),
        (["--overlay", "reference: !PlanReference {}"], "generated or a Motion"),
        (["--overlay", "reference: !MotionReference {}"], ""),
        (["--overlay", "robot: spot", "--robot", "dog"], "Unknown robot"),
        (["--overlay", "reference: !GeneratedReference {duration: 1e9}"], "duration"),
    ],
)
def test_a_scenario_that_cannot_be_simulated_is_one_sentence(
    arguments, message, capsys
):
    assert main(["simulate", "--no-meshcat", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error


def test_options_of_generated_motion_do_not_go_with_a_scenarios_file(tmp_path, capsys):
    save_motion(synthetic_motion("dog-pace", seconds=1.0), tmp_path / "a.npz")
    overlay = f"reference: !MotionReference {{path: {tmp_path / 'a.npz'}}}"
    line = ["simulate", "--no-meshcat", "--overlay", overlay, "--gait", "dog-trot"]
    assert main(line) == 2
    assert "add --reference generated" in capsys.readouterr().err


def test_a_constant_command_is_followed(weights, tmp_path):
    """It turns the slow, straight motion of the default into a fast turn."""
    line = ("--duration", 2, "--no-meshcat", "--policy", weights / "calm.safetensors")
    free = simulate(tmp_path, *line)
    slow = simulate(tmp_path, *line, "--command", 0.4, 0.0, 0.0)
    assert 0.2 < slow["speed_mps"] < 0.6 < free["speed_mps"]


def test_a_command_chooses_any_gait(weights, tmp_path):
    """The run is that of the gait itself, to the last bit."""
    gaits = measured_gaits(get_robot("go2"))
    line = ("--duration", 1, "--no-meshcat", "--policy", weights / "calm.safetensors")
    for speed in (0.1, 1.5):
        command = ("--command", speed, 0.0, 0.0)
        gait = str(LABELS[best_gait(gaits, np.array([speed, 0.0, 0.0]))])
        chosen = simulate(tmp_path, *line, *command, "--gait", "any")
        assert (chosen.pop("gait"), chosen.pop("chosen")) == ("any", gait)
        named = simulate(tmp_path, *line, *command, "--gait", gait)
        assert named.pop("gait") == gait
        del named["real_time_factor"], chosen["real_time_factor"]
        assert named == chosen


def test_any_gait_needs_a_command(capsys):
    assert main(["simulate", "--no-meshcat", "--gait", "any"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "The gait any is chosen by the command: add --command" in error


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("nan 0 0", "A command's forward must be a number from -4 to 4, not nan"),
        ("0 inf 0", "A command's sideways must be a number from -2 to 2, not inf"),
        ("0 0 9", "A command's yaw rate must be a number from -4 to 4, not 9"),
    ],
)
def test_commands_beyond_sense_are_refused(command, message, capsys):
    assert main(["simulate", "--no-meshcat", "--command", *command.split()]) == 2
    assert message in capsys.readouterr().err


def test_a_command_needs_steering(capsys):
    line = ["simulate", "--no-meshcat", "--command", "1", "0", "0", "--overlay"]
    assert main([*line, "steering: null"]) == 2
    assert "--command needs a scenario with steering" in capsys.readouterr().err
