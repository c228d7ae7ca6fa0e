"""The commands that the page names exist, with their options."""

import shlex
from importlib import import_module

import pytest
import tyro

from loco_drake.cli.main import _COMMANDS
from loco_drake.evaluation.report.expected import EXPECTED


@pytest.mark.parametrize("file", EXPECTED, ids=lambda file: file.path)
def test_commands_are_of_this_command_line(file):
    program, first, second, *options = shlex.split(file.command)
    assert program == "loco-drake"
    module, class_name, _ = _COMMANDS[f"{first} {second}"]
    command = getattr(import_module(f"loco_drake.cli.{module}"), class_name)
    made = tyro.cli(command, args=[*options, "--json", file.path])
    assert str(made.json) == file.path
    assert made.robot in ("all", *file.robots)


def test_paths_are_distinct_and_name_their_robot():
    assert len({file.path for file in EXPECTED}) == len(EXPECTED)
    for file in EXPECTED:
        if len(file.robots) == 1:
            assert f"-{file.robots[0]}" in file.path
