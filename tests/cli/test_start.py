"""What a command imports before it has anything to do."""

import pytest

from loco_drake.cli.main import _COMMANDS
from tests.process import run_python

# Each of these takes .2 to 2.6 s of processor time to import.
SLOW = ("torch", "pydrake", "matplotlib", "stable_baselines3", "sklearn", "toppra")
HELP = f"""
import sys
from loco_drake.cli.main import main

try:
    main([*sys.argv[1:], "--help"])
finally:
    print("imported:", *(name for name in {SLOW} if name in sys.modules))
"""


LIGHT = [n for n in _COMMANDS if not n.startswith(("evaluate", "report", "train tr"))]


@pytest.mark.parametrize("name", LIGHT)
def test_help_waits_for_no_slow_library(name, tmp_path):
    printed = run_python("-c", HELP, *name.split(), cwd=tmp_path)
    assert f"loco-drake {name}" in printed
    assert printed.splitlines()[-1] == "imported:"
