"""The page's commands exist, and have the options that a result was made with."""

import json
import shlex

import pytest
import tyro

from loco_drake.cli.main import command_class
from loco_drake.evaluation.report.results import EXPECTED, commands, load_results
from tests.report_results import tokenizer, tracking, write_results


def test_options_follow_the_conditions(tmp_path):
    lagged = {**tracking("a1"), "contact": "lagged", "time_step_s": 0.002}
    recorded = {**tracking(), "reference": "retargeted", "duration_s": 4.0}
    elsewhere = {"simulator": "mujoco", "contact": "elliptic", "time_step_s": 0.002}
    write_results(
        tmp_path,
        tracking_go2_generated=tracking(episodes=7),
        tracking_go2_mujoco={**tracking(), **elsewhere},
        tracking_go2_retargeted=recorded,
        tracking_a1_lagged=lagged,
        tracking_a1_pushes=tracking("a1"),
        tokenizer={"robot": "go2", **tokenizer()},
    )
    found = commands(load_results(tmp_path))
    start = "loco-drake evaluate tracking --robot"
    assert found["tracking-go2-generated.json"] == f"{start} go2 --seeds 7"
    assert found["tracking-go2-mujoco.json"] == (
        f"{start} go2 --simulator mujoco --seeds 20"
    )
    assert found["tracking-go2-retargeted.json"] == (
        f"{start} go2 --reference retargeted --duration 4 --seeds 20"
    )
    assert found["tracking-a1-lagged.json"] == (
        f"{start} a1 --contact lagged --time-step 0.002 --seeds 20"
    )
    assert found["tracking-a1-pushes.json"] == f"{start} a1 --pushes --seeds 20"
    assert found["tokenizer.json"] == "loco-drake evaluate tokenizer --robot all"


def test_what_is_missing_has_the_usual_command(tmp_path):
    write_results(tmp_path, tokenizer={"robot": "go2", **tokenizer()})
    found = commands(load_results(tmp_path))
    assert found["tracking-go2-cenic.json"].endswith("--contact cenic --seeds 5")


def test_other_policies_and_worlds_are_in_the_command(tmp_path):
    name = "tracking-a1-unprivileged_policy-randomized.json"
    write_results(tmp_path, tokenizer={"robot": "go2", **tokenizer()})
    text = json.dumps(tracking("a1", episodes=3))
    (tmp_path / name).write_text(text)
    assert commands(load_results(tmp_path))[name] == (
        "loco-drake evaluate tracking --robot a1 "
        "--policy unprivileged --randomize --seeds 3"
    )


@pytest.mark.parametrize("file", EXPECTED, ids=lambda file: file.path)
def test_commands_are_of_this_command_line(file):
    program, first, second, *options = shlex.split(file.command)
    assert program == "loco-drake"
    made = tyro.cli(
        command_class(f"{first} {second}"), args=[*options, "--json", file.path]
    )
    assert str(made.json) == file.path
    # The robot of a training is that of its environment.
    of = made.environment if hasattr(made, "environment") else made
    assert of.robot in ("all", *file.robots)


def test_paths_are_distinct_and_name_their_robot():
    assert len({file.path for file in EXPECTED}) == len(EXPECTED)
    for file in EXPECTED:
        if len(file.robots) == 1:
            assert f"-{file.robots[0]}" in file.path
