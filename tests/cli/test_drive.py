"""Drives by tables, records and their repetition; tests/cli/test_drive_live.py drives
by hand.
"""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from loco_drake.cli import drive_view
from loco_drake.cli.main import main
from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import save_actor
from loco_drake.control.drive_file import load_drive
from loco_drake.control.gait_choice import PAUSE, Choice, next_choice
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS
from loco_drake.systems.gait_selector import measured_gaits

TABLE = """time,forward,sideways,yaw_rate,gait,push,reset
0,0.6,0,0,,,
0.5,0.3,0.1,0.8,,5,
0.9,0.5,0,-0.4,dog-pace,,
1.2,0.5,0,-0.4,dog-pace,,1
"""
# Without them two runs of one drive have the same figures.
TIMES = ("real_time_factor", "wall_clock_s")


def drive(folder, *arguments):
    """Runs the command without Meshcat; returns its figures."""
    path = folder / "figures.json"
    line = ["drive", "--no-meshcat", *map(str, arguments), "--json", str(path)]
    assert main(line) == 0
    figures = json.loads(path.read_text())
    assert all(figures.pop(name) > 0 for name in TIMES)
    return figures


@pytest.fixture(scope="module")
def recorded(weights, tmp_path_factory):
    """A table, the drive that was recorded of it, and its figures."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "commands.csv").write_text(TABLE)
    line = ("--commands", folder / "commands.csv", "--duration", 1.6)
    policy = ("--policy", weights / "calm.safetensors", "--seed", 3)
    gait = ("--gait", "dog-trot")
    figures = drive(folder, *line, *policy, *gait, "--record", folder / "a.drive")
    return folder, figures


def test_a_table_drives_and_is_recorded(recorded):
    folder, figures = recorded
    assert (figures["robot"], figures["gait"], figures["seed"]) == (
        "go2",
        "dog-trot",
        3,
    )
    assert figures["duration_s"] == figures["simulated_s"] == 1.6
    # The plan follows the commands, and the robot the plan.
    assert 0 < figures["velocity_rmse_mps"] < 1.0
    assert 0 < figures["yaw_rate_rmse_radps"] < 2.0
    assert 0 < figures["latency_reference_s"] <= 0.3
    assert "latency_robot_s" in figures
    record = load_drive(folder / "a.drive")
    np.testing.assert_allclose(record.table.times, [0.0, 0.5, 0.9, 1.2])
    np.testing.assert_array_equal(
        record.table.rows,
        [
            [0.6, 0, 0, 1, 0, 0],
            [0.3, 0.1, 0.8, 1, 5, 0],
            [0.5, 0, -0.4, 0, 0, 0],
            [0.5, 0, -0.4, 0, 0, 1],
        ],
    )
    assert record.header["steps"] == 80


def test_a_recorded_drive_is_repeated_to_the_last_bit(recorded, tmp_path, capsys):
    """Push, reset, turns, gait and seed; and a record of the repetition is the same."""
    folder, figures = recorded
    again = tmp_path / "again.drive"
    line = ("--replay", folder / "a.drive", "--record", again)
    repeated = drive(tmp_path, *line)
    assert repeated.pop("identical") is True
    assert repeated == figures
    assert again.read_bytes() == (folder / "a.drive").read_bytes()
    assert "differ" not in capsys.readouterr().err


def test_part_of_a_recorded_drive_can_be_repeated(recorded, tmp_path):
    folder, _ = recorded
    line = ("--replay", folder / "a.drive", "--duration", 0.5)
    figures = drive(tmp_path, *line)
    assert "identical" not in figures
    assert figures["simulated_s"] == 0.5


def test_each_order_changes_the_states(recorded, weights, tmp_path):
    """Else the repetition above would prove little."""
    folder, _ = recorded
    hashes = set()
    rows = TABLE.splitlines()
    for left_out in range(2, 6):
        table = tmp_path / "commands.csv"
        changed = rows[:left_out] + rows[left_out + 1 :]
        if left_out == 5:
            changed = [line.replace(",5,", ",,") for line in rows]
        table.write_text("\n".join(changed))
        policy = ("--policy", weights / "calm.safetensors", "--seed", 3)
        record = tmp_path / "a.drive"
        line = ("--commands", table, "--duration", 1.6, "--record", record)
        drive(tmp_path, *line, *policy, "--gait", "dog-trot")
        hashes.add(load_drive(record).header["states_sha256"])
    hashes.add(load_drive(folder / "a.drive").header["states_sha256"])
    assert len(hashes) == 5


def test_states_that_differ_are_said(recorded, tmp_path, capsys, monkeypatch):
    folder, _ = recorded
    monkeypatch.setattr(
        "loco_drake.control.drive_file.states_sha256", lambda states: "other"
    )
    figures = drive(tmp_path, "--replay", folder / "a.drive")
    assert figures["identical"] is False
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "The states differ from the recorded ones" in error


def test_a_constant_command_is_that_of_simulate(weights, tmp_path):
    """Of which --duration also is the duration that the generator is told."""
    table = tmp_path / "commands.csv"
    table.write_text("time,forward,sideways,yaw_rate\n0,0.5,0.1,0.4\n")
    line = ("--policy", str(weights / "calm.safetensors"), "--duration", "1.0")
    overlay = "reference: !GeneratedReference {duration: 1.0, gait: dog-trot}"
    driven = drive(tmp_path, "--commands", table, *line, "--overlay", overlay)
    path = str(tmp_path / "simulated.json")
    command = ("--command", "0.5", "0.1", "0.4", "--no-meshcat", "--json", path)
    assert main(["simulate", *line, *command]) == 0
    simulated = json.loads((tmp_path / "simulated.json").read_text())
    del simulated["real_time_factor"]
    assert {name: driven[name] for name in simulated} == simulated


def test_a_robot_that_fell_lies_until_it_is_put_upright(weights, tmp_path):
    """It earns nothing while it lies, and falls again with this policy."""
    table = tmp_path / "commands.csv"
    line = ("--commands", table, "--policy", weights / "wild.safetensors")
    head = "time,forward,sideways,yaw_rate,reset\n0,0.5,0,0,0\n"
    table.write_text(head)
    lying = drive(tmp_path, *line, "--duration", 3)
    assert (lying["fell"], lying["falls"]) == (True, 1)
    assert lying["simulated_s"] == 3.0
    table.write_text(f"{head}2,0.5,0,0,1\n")
    upright = drive(tmp_path, *line, "--duration", 3)
    assert upright["falls"] >= 1
    assert upright["normalized_return"] > lying["normalized_return"]


def test_a_table_is_driven_on_for_three_seconds(weights, tmp_path):
    table = tmp_path / "commands.csv"
    table.write_text("time,forward,sideways,yaw_rate\n0,0,0,0\n0.2,0.4,0,0\n")
    line = ("--commands", table, "--policy", weights / "calm.safetensors")
    assert drive(tmp_path, *line)["simulated_s"] == 3.2


def chosen(*speeds):
    """Returns the gaits of forward velocities that follow one another, as a drive's."""
    gaits, choice, labels = measured_gaits(get_robot("go2")), Choice(-1), []
    for k, speed in enumerate(speeds):
        choice = next_choice(gaits, np.array([speed, 0.0, 0.0]), choice, k * PAUSE)
        labels.append(str(LABELS[choice.label]))
    return labels


def test_the_commands_choose_the_gait_unless_one_is_named(weights, tmp_path):
    """From the beginning on; and a record of it is repeated to the last bit."""
    table, record = tmp_path / "commands.csv", tmp_path / "a.drive"
    head = "time,forward,sideways,yaw_rate,gait\n"
    table.write_text(f"{head}0,0.1,0,0,\n0.4,1.8,0,0,\n1.5,0.5,0,0,dog-pace\n")
    line = ("--commands", table, "--policy", weights / "calm.safetensors")
    figures = drive(tmp_path, *line, "--duration", 2, "--record", record)
    assert figures["gait"] == "any"
    np.testing.assert_array_equal(load_drive(record).table.rows[:, 3], [-1, -1, 0])
    assert drive(tmp_path, "--replay", record)["identical"] is True
    hashes = {load_drive(record).header["states_sha256"]}
    for gait in chosen(0.1, 1.8):
        drive(tmp_path, *line, "--duration", 2, "--record", record, "--gait", gait)
        hashes.add(load_drive(record).header["states_sha256"])
    assert len(hashes) == 3


class Screen:
    """Stands for the line in a terminal."""

    def __init__(self, shown):
        self.shown = shown
        self.start = self.stop = lambda: None

    def update(self, text, *, refresh):
        self.shown.append(text.plain)


def test_the_line_shows_the_gait_that_is_walked(weights, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(drive_view, "Live", lambda *a, **options: Screen(shown))
    terminal = SimpleNamespace(is_terminal=True)
    monkeypatch.setattr(drive_view, "Console", lambda stderr: terminal)
    table = tmp_path / "commands.csv"
    head = "time,forward,sideways,yaw_rate,gait\n"
    table.write_text(f"{head}0,0.1,0,0,any\n0.7,1.8,0,0,\n1.7,0.5,0,0,dog-pace\n")
    line = ("--commands", table, "--policy", weights / "calm.safetensors")
    drive(tmp_path, *line, "--duration", 3)
    titles, runs = zip(*(line.split("  |  ")[:2] for line in shown), strict=True)
    times = [float(run.split(" s  ")[0]) for run in runs]
    # Twice a second, and when the gait changes.
    assert set(np.arange(1, 7) / 2) < set(times)
    assert len(times) == 9
    # The order counts at once, the gait when its plan is played; what has changed is
    # told for 2 s.
    slow, fast = chosen(0.1, 1.8)
    changed = [f"{slow} → {fast}", f"{fast} → dog-pace"]
    assert list(dict.fromkeys(titles)) == [
        f"any: {slow}",
        f"any: {changed[0]}",
        changed[0],
        changed[1],
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("", "add --commands or --replay"),
        ("--commands none.csv", "There is no file 'none.csv'"),
        ("--commands words.csv", "its first line must name the columns"),
        (
            "--commands good.csv --gait dog-fly",
            "Unknown gait 'dog-fly'; the choices are any, dog-pace",
        ),
        ("--commands good.csv --gait dog-pace,dog-trot@3", "not with a schedule"),
        ("--commands good.csv --robot spot", "Unknown robot 'spot'"),
        ("--commands good.csv --duration 0", "The duration must be above 0"),
        ("--commands good.csv --duration nan", "The duration must be above 0"),
        ("--commands good.csv --seed -1", "The seed must be 0 or more"),
        (
            "--commands good.csv --policy none.safetensors",
            "There are no policy weights",
        ),
        ("--commands good.csv --overlay steering:{null}", "cannot be read"),
        ("--commands good.csv --scenario none.yaml", "no scenario file"),
        ("--replay none.drive", "There is no file 'none.drive'"),
        ("--replay good.csv", "is not a drive that loco-drake drive recorded"),
        ("--replay cut.drive", "cut.drive is damaged"),
        ("--replay good.drive --gait dog-trot", "leave out --gait"),
        ("--replay good.drive --seed 1", "leave out --seed"),
        ("--replay good.drive --commands good.csv", "leave out --commands"),
        ("--replay good.drive --policy other.safetensors", "name these with --policy"),
    ],
)
def test_wrong_input_is_one_sentence_and_status_2(
    arguments, message, recorded, tmp_path, monkeypatch, capsys
):
    folder, _ = recorded
    monkeypatch.chdir(tmp_path)
    good = (folder / "a.drive").read_bytes()
    (tmp_path / "good.drive").write_bytes(good)
    (tmp_path / "cut.drive").write_bytes(good[:-30])
    (tmp_path / "good.csv").write_text(TABLE)
    (tmp_path / "words.csv").write_text("forward march\n")
    actor = Actor(ActorConfig(robot="go2", labels=["dog-trot"]))
    save_actor(actor, tmp_path / "other.safetensors")
    before = sorted(tmp_path.iterdir())
    line = ["drive", "--no-meshcat", *arguments.split(), "--json", "figures.json"]
    assert main([*line, "--record", "new.drive"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("overlay", "message"),
    [
        ("steering: null", "The gait any needs steering"),
        (
            "{steering: null, reference: !GeneratedReference {gait: dog-trot}}",
            "must have steering and a trained policy",
        ),
        ("policy: !ExternalAction {}", "must have steering and a trained policy"),
        ("reference: !PlanReference {}", "must be generated"),
    ],
)
def test_scenarios_that_cannot_be_driven_are_refused(overlay, message, capsys):
    assert main(["drive", "--overlay", overlay]) == 2
    assert message in capsys.readouterr().err


def test_a_scenario_is_recorded_with_all_that_matters(weights, tmp_path):
    """Nulls, which Drake's YAML leaves out, and another contact solver among it."""
    table = tmp_path / "commands.csv"
    table.write_text("time,forward,sideways,yaw_rate\n0,0.4,0,0\n")
    overlay = "{smoother: null, plant: {contact: lagged, friction: 0.5}}"
    policy = ("--policy", weights / "calm.safetensors", "--robot", "go2")
    line = ("--commands", table, "--overlay", overlay, "--duration", 0.5)
    record = tmp_path / "a.drive"
    drive(tmp_path, *line, *policy, "--record", record)
    assert drive(tmp_path, "--replay", record)["identical"] is True


@pytest.mark.slow
def test_pictures_do_not_change_the_steps_of_an_integrator(weights, tmp_path):
    """A drive that was seen is repeated unseen, also with error control."""
    table, record = tmp_path / "commands.csv", tmp_path / "a.drive"
    table.write_text("time,forward,sideways,yaw_rate\n0,0.4,0,0\n0.3,0.3,0,0.4\n")
    policy = ("--policy", weights / "calm.safetensors", "--duration", 0.8)
    line = ("--commands", table, "--overlay", "plant: {contact: cenic}", *policy)
    assert main(["drive", *map(str, line), "--record", str(record)]) == 0
    assert drive(tmp_path, "--replay", record)["identical"] is True
