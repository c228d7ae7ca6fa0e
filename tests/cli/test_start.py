"""What a command imports, and when."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from loco_drake.cli.main import _COMMANDS
from tests.process import LIMIT, run_python

# Each of these takes .2 to 2.6 s of processor time to import.
SLOW = ("torch", "pydrake", "matplotlib", "stable_baselines3", "sklearn", "toppra")
HELP = f"""
import contextlib
import sys
from loco_drake.cli.main import main

for name in sys.argv[1:]:
    with contextlib.suppress(SystemExit):
        main([*name.split(), "--help"])
    found = [slow for slow in {SLOW} if slow in sys.modules]
    print("imported after", name, *found)
"""
# Bounds of their worlds come from a robot's model, which takes .2 s.
WORLDS = ("evaluate tracking", "train tracker", "train guided", "train student")


@pytest.mark.parametrize("worlds", [False, True])
def test_help_waits_for_no_slow_library(worlds, tmp_path):
    """The help of one command after the other, in one process."""
    names = [name for name in _COMMANDS if (name in WORLDS) == worlds]
    printed = run_python("-c", HELP, *names, cwd=tmp_path)
    assert all(f"loco-drake {name}" in printed for name in names)
    lines = [x for x in printed.splitlines() if x.startswith("imported after")]
    drake = " pydrake" * worlds
    assert lines == [f"imported after {name}{drake}" for name in names]


LACKS = """
raise ImportError(
    "libX11.so.6: cannot open shared object file: No such file or directory"
)
"""
SIMULATE = "from loco_drake.cli.main import main; raise SystemExit(main(['simulate']))"


def test_a_missing_system_library_is_one_sentence_that_says_how_to_get_it(tmp_path):
    """As on a bare Debian, where importing Drake fails with this error."""
    (tmp_path / "pydrake").mkdir()
    (tmp_path / "pydrake" / "__init__.py").write_text(LACKS)
    process = subprocess.run(
        [sys.executable, "-c", SIMULATE],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert process.returncode == 1
    command = "apt-get install libx11-6 libsm6 libglib2.0-0"
    assert process.stderr == (
        "loco-drake: This system lacks libX11.so.6; on Debian or Ubuntu, install it "
        f"with: {command}.\n"
    )
    readme = (Path(__file__).parents[2] / "README.md").read_text()
    assert command.split()[2:] == next(
        line.split()[-3:] for line in readme.splitlines() if "apt-get install" in line
    )
