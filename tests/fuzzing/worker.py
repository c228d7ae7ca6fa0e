"""Runs commands, each in a fork of one warm process, with limits on what they take.

Started as ``python -m tests.fuzzing.worker``; takes and gives one JSON object a line.
"""

import contextlib
import importlib
import json
import os
import pkgutil
import resource
import select
import signal
import subprocess
import sys
import traceback
from dataclasses import dataclass
from pathlib import Path

MEMORY = 2 * 2**30  # bytes that a command may take beyond what is loaded
CPU = 20  # seconds beyond those of the clean run
WALL = 60  # the same, for what waits; the machine may be busy
FILE = 2**28  # bytes of a file that a command may write
# What commands import when they run.
LIBRARIES = ("torch.utils.tensorboard", "matplotlib.pyplot", "scipy.signal")
TRACEBACK = 70  # exit status of a command that raised


@dataclass(frozen=True)
class Run:
    """What became of a command.

    Attributes:
        status: as a shell has it, negative for a signal; None: it took too long.
        stdout: what it printed.
        stderr: and there.
        seconds: CPU time.
        memory: most resident bytes.
    """

    status: int | None
    stdout: str
    stderr: str
    seconds: float
    memory: int


class Worker:
    """The process that forks; starts when it is first needed, again if it dies."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def run(
        self,
        argv: list[str],
        cwd: Path,
        patches: dict[str, str] | None = None,
        environment: dict[str, str] | None = None,
        seconds: float = 0.0,
    ) -> Run:
        """Runs ``loco-drake ARGV``.

        Args:
            argv: the command's.
            cwd: the folder to run it in.
            patches: constants to replace by paths, module.NAME to path.
            environment: variables to set.
            seconds: CPU time that the clean command took.
        """
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzzing.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env={**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"},
            )
        request = {
            "argv": argv,
            "cwd": str(cwd),
            "patches": patches or {},
            "environment": environment or {},
            "seconds": seconds,
        }
        pipes = self._process.stdin, self._process.stdout
        assert pipes[0] is not None
        assert pipes[1] is not None
        print(json.dumps(request), file=pipes[0], flush=True)
        return Run(**json.loads(pipes[1].readline()))

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            assert self._process.stdin is not None
            self._process.stdin.close()
            try:
                self._process.wait(30)
            except subprocess.TimeoutExpired:  # it has no work to lose
                self._process.kill()
                self._process.wait()
            assert self._process.stdout is not None
            self._process.stdout.close()
            self._process = None


def _child(request: dict, out: int, err: int) -> None:
    os.setpgid(0, 0)  # to end what it starts; it keeps the session's priority
    null = os.open(os.devnull, os.O_RDONLY)
    for own, other in ((0, null), (1, out), (2, err)):
        os.dup2(other, own)
    os.chdir(request["cwd"])
    os.environ.update(request["environment"])
    size = int(Path("/proc/self/statm").read_text().split()[0]) * 4096
    cpu = int(request["seconds"]) + CPU + 1
    for kind, limit in (
        (resource.RLIMIT_AS, size + MEMORY),
        (resource.RLIMIT_CPU, cpu),
        (resource.RLIMIT_FSIZE, FILE),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(kind, (limit, limit))
    for name, path in request["patches"].items():
        module, constant = name.rsplit(".", 1)
        setattr(importlib.import_module(module), constant, Path(path))
    from loco_drake.cli.main import main

    status = TRACEBACK
    try:
        status = main(request["argv"])
    except SystemExit as error:
        status = error.code if isinstance(error.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except (OSError, ValueError):
                status = TRACEBACK
        os._exit(status)


def _run(request: dict) -> dict:
    streams = [os.memfd_create(name) for name in ("out", "err")]
    pid = os.fork()
    if pid == 0:
        _child(request, *streams)
    ends, late = os.pidfd_open(pid), False
    if not select.select([ends], [], [], request["seconds"] + WALL)[0]:
        late = True
        os.kill(pid, signal.SIGKILL)
    _, code, usage = os.wait4(pid, 0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)  # what it may have started
    texts = []
    for stream in streams:
        size = os.fstat(stream).st_size
        texts.append(os.pread(stream, min(size, 2**20), 0).decode(errors="replace"))
        os.close(stream)
    os.close(ends)
    status = os.waitstatus_to_exitcode(code)
    late |= status in (-signal.SIGXCPU, -signal.SIGKILL)
    return {
        "status": None if late else status,
        "stdout": texts[0],
        "stderr": texts[1],
        "seconds": usage.ru_utime + usage.ru_stime,
        "memory": usage.ru_maxrss * 1024,
    }


def _serve() -> None:
    # What the commands import, once; they print to stdout, which is the protocol's.
    protocol = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    import loco_drake

    for module in pkgutil.walk_packages(loco_drake.__path__, "loco_drake."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name in LIBRARIES:
        importlib.import_module(name)
    for line in sys.stdin:
        print(json.dumps(_run(json.loads(line))), file=protocol, flush=True)
    os._exit(0)  # at once: there is nothing to put away


if __name__ == "__main__":
    _serve()
