"""Pictures of steering: what they show is what was commanded and what was done."""

import json
from dataclasses import replace

import numpy as np
import pytest

from loco_drake.cli.main import main
from loco_drake.control.command import CommandRange
from loco_drake.control.ground_path import ground_pose
from loco_drake.control.plan import PLAN_DT, plan_from_motion
from loco_drake.evaluation import steering_pictures
from loco_drake.evaluation.steering_pictures import (
    Drive,
    eight_figure,
    figure_of_eight,
    response_figure,
)
from tests.report_results import steering
from tests.synthetic_motion import synthetic_motion

BOX = CommandRange((-0.5, -0.3, -1.0), (2.0, 0.3, 1.0))


@pytest.fixture
def drive(go2):
    """The robot does .6 m/s, its plan .8; it is to do as a figure of eight."""
    slow, fast = (
        plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, speed)).state
        for speed in (0.6, 0.8)
    )
    commands = figure_of_eight(BOX)[: len(slow)]
    return Drive(go2, "dog-trot", commands, slow, fast, fell=False)


def test_a_figure_of_eight_is_two_circles_and_ends_where_it_began():
    """By hand: at .8 m/s and .8 rad/s circles of 1 m, 7.85 s each."""
    commands = figure_of_eight(BOX)
    assert len(commands) * PLAN_DT == pytest.approx(2 * 2 * np.pi / 0.8, abs=0.04)
    half = len(commands) // 2
    assert commands[0].tolist() == [0.8, 0.0, 0.8]
    assert (commands[:half] == commands[0]).all()
    assert (commands[half:] == [0.8, 0.0, -0.8]).all()
    path = steering_pictures.integrate(np.zeros(3), commands)
    np.testing.assert_allclose(path[[half - 1, -1], :2], 0.0, atol=0.02)
    assert path[:, 1].max() == pytest.approx(2.0, abs=0.01)
    assert path[:, 1].min() == pytest.approx(-2.0, abs=0.02)


def test_a_figure_of_eight_stays_in_the_range_of_the_gait():
    slow = CommandRange((0.1, 0.0, -0.3), (0.5, 0.0, 0.6))
    commands = figure_of_eight(slow)
    assert np.unique(commands, axis=0).tolist() == [[0.5, 0, -0.3], [0.5, 0, 0.3]]
    assert len(commands) * PLAN_DT == pytest.approx(2 * 2 * np.pi / 0.3, abs=0.04)
    straight = CommandRange((0.1, 0.0, -0.1), (0.5, 0.0, 1.0))
    assert figure_of_eight(straight) is None


def test_the_response_shows_command_plan_and_robot(drive):
    figure = response_figure(drive)
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "forward, m/s",
        "sideways, m/s",
        "yaw rate, rad/s",
    ]
    command, plan, robot = (line.get_data() for line in figure.axes[0].lines)
    np.testing.assert_array_equal(command[0], np.arange(len(drive.state)) * PLAN_DT)
    assert (command[1] == 0.8).all()
    inner = slice(25, -25)
    np.testing.assert_allclose(plan[1][inner], 0.8, atol=0.02)
    np.testing.assert_allclose(robot[1][inner], 0.6, atol=0.02)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [name.split(",")[0] for name in names] == ["command", "plan", "robot"]


def test_the_path_of_the_commands_begins_where_the_robot_does(drive):
    figure = eight_figure(drive)
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x, m", "y, m")
    assert axes.get_aspect() == 1.0
    ideal, _, robot = (np.column_stack(line.get_data()) for line in axes.lines[:3])
    pose = ground_pose(drive.state)
    np.testing.assert_array_equal(robot, pose[:, :2])
    np.testing.assert_array_equal(ideal[0], robot[0])
    assert len(ideal) == len(robot)
    # Every point is 1 m from the middle of the circle, to the left of the start.
    middle = pose[0, :2] + [-np.sin(pose[0, 2]), np.cos(pose[0, 2])]
    np.testing.assert_allclose(np.linalg.norm(ideal - middle, axis=1), 1.0, atol=1e-3)


def test_a_fall_is_told_in_the_title(drive):
    fallen = replace(drive, state=drive.state[:100], fell=True)
    assert fallen.title == "go2, dog-trot, fell after 2.0 s"
    assert drive.title == "go2, dog-trot"


@pytest.mark.slow
def test_the_command_writes_all_pictures(tmp_path, monkeypatch, capsys):
    """With figures made by hand in place of an hour of simulation, and short drives."""
    made = steering()["labels"]
    monkeypatch.setattr(
        "loco_drake.evaluation.steering_table.run_courses", lambda *_: made.items()
    )
    monkeypatch.setattr(steering_pictures, "_SECONDS", 2.0)
    monkeypatch.setattr(
        steering_pictures, "figure_of_eight", lambda within: np.full((50, 3), 0.2)
    )
    figures, pictures = tmp_path / "x.json", tmp_path / "pictures"
    line = ["evaluate", "steering", "--labels", "dog-trot", "mpc-trot"]
    line += ["--json", str(figures), "--figures", str(pictures)]
    assert main(line) == 0
    assert sorted(path.name for path in pictures.iterdir()) == sorted(
        f"go2-{name}.png"
        for name in (
            "grid",
            *(f"{label}-{kind}" for label in made for kind in ("response", "eight")),
        )
    )
    assert list(json.loads(figures.read_text())["labels"]) == list(made)
    assert "-0.50" in capsys.readouterr().out
