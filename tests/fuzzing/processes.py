"""Runs commands as a shell does, to compare with those of the warm process."""

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.fuzzing.worker import FILE, TRACEBACK, WALL, Run

_PATCHED = """
import importlib, sys
from pathlib import Path
patches, sys.argv[1:] = sys.argv[1].split("\\n"), sys.argv[2:]
for patch in patches:
    name, path = patch.split("=", 1)
    module, constant = name.rsplit(".", 1)
    setattr(importlib.import_module(module), constant, Path(path))
from loco_drake.cli.main import main
sys.exit(main())
"""


def run_process(
    argv: list[str],
    cwd: Path,
    patches: dict[str, str],
    environment: dict[str, str],
    seconds: float,
) -> Run:
    """Runs the console script; with patches, the function that it calls.

    See :meth:`.worker.Worker.run` for the arguments. CPU time and memory are not
    measured.
    """
    script = [str(Path(sys.executable).with_name("loco-drake"))]
    if patches:
        told = "\n".join(f"{name}={path}" for name, path in patches.items())
        script = [sys.executable, "-c", _PATCHED, told]
    own = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", **environment}
    limits = ["prlimit", f"--as={16 * 2**30}", f"--fsize={FILE}", "--core=0", "--"]
    try:
        ended = subprocess.run(
            [*limits, *script, *argv],
            cwd=cwd,
            env={**os.environ, **own},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=5 * (seconds + WALL),
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Run(None, "", "", 0.0, 0)
    texts = [s.decode(errors="replace") for s in (ended.stdout, ended.stderr)]
    traced = "Traceback (most recent call last)" in texts[1]
    return Run(TRACEBACK if traced else ended.returncode, *texts, 0.0, 0)


def difference(warm: Run, real: Run) -> str:
    """Returns in what a real process ended otherwise; empty if in nothing."""
    if warm.status != real.status:
        return f"status {real.status}, not {warm.status}: {real.stderr[-300:]!r}"
    one, other = (_told(run.stderr) for run in (warm, real))
    return "" if one == other else f"it said {other!r}, not {one!r}"


def _told(text: str) -> list[str]:
    """Returns the lines but for progress bars and measured times."""
    lines = [re.sub(r"[\d.]+ ?s\b", "N s", line) for line in text.split("\n")]
    return [line for line in lines if line and "\u2501" not in line]
