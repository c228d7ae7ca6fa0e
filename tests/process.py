"""Python in another process."""

import os
import subprocess
import sys
from pathlib import Path

# First line of scripts that are to be interrupted: shells start what they run in the
# background deaf to Ctrl-C, and these tests may be run so.
HEAR_CTRL_C = "import signal; signal.signal(2, signal.default_int_handler)\n"


def run_python(*arguments: object, cwd: Path, **environment: str) -> str:
    """Returns what ``python ARGUMENTS`` prints; it must succeed.

    Args:
        arguments: a script or -m or -c, and what follows.
        cwd: the folder to run it in.
        environment: variables beside those of this process.
    """
    process = subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return process.stdout
