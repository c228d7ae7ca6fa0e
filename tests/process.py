"""Python in another process."""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

# First line of scripts that are to be interrupted: shells start what they run in the
# background deaf to Ctrl-C, and these tests may be run so.
HEAR_CTRL_C = "import signal; signal.signal(2, signal.default_int_handler)\n"

# Seconds after which a process hangs: far more than any takes on a slow, busy machine.
LIMIT = 900


class Process(NamedTuple):
    """A process of this machine that has not ended."""

    pid: int
    parent: int
    command: str


def processes() -> dict[int, Process]:
    """Returns those that run now by their id; zombies have ended.

    From /proc where there is one: small systems lack ps and pgrep.
    """
    if not Path("/proc/self/stat").exists():
        line = ["ps", "-axo", "pid=,ppid=,stat=,command="]
        found = subprocess.run(line, capture_output=True, text=True, check=True)
        rows = [row.split(maxsplit=3) for row in found.stdout.splitlines()]
    else:
        rows = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                # The second field, a name in brackets, may hold anything.
                fields = (folder / "stat").read_text().rsplit(") ", 1)[1].split()
                command = (folder / "cmdline").read_text().replace("\0", " ")
            except OSError:  # it has ended meanwhile
                continue
            rows.append([folder.name, fields[1], fields[0], command])
    return {
        int(pid): Process(int(pid), int(parent), command)
        for pid, parent, state, command in rows
        if not state.startswith("Z")
    }


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
        timeout=LIMIT,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return process.stdout
