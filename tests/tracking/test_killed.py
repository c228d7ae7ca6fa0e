"""Trainings that end by SIGKILL: ``loco-drake train tracker`` as people run it."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from loco_drake.common.run_folder import read_checkpoint
from loco_drake.control.actor_file import load_actor
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion_file import save_motion
from tests.process import LIMIT, processes
from tests.synthetic_motion import synthetic_motion

pytestmark = pytest.mark.slow

COMMAND = "from loco_drake.cli.main import main; raise SystemExit(main())"
BATCH = 64


@pytest.fixture(scope="module")
def references(tmp_path_factory):
    folder = tmp_path_factory.mktemp("references")
    save_motion(synthetic_motion("dog-trot", 2.0, 0.3), folder / "trot.npz")
    return folder


@pytest.fixture
def train(references):
    """Starts a training of two environments a worker; all of it ends with the test."""
    started = []

    def start(out, *arguments):
        options = {"references": references, "out": out, "batch": BATCH}
        line = [f"--{name}={value}" for name, value in options.items()]
        line += ["--per-worker=2", *arguments]
        process = subprocess.Popen(
            [sys.executable, "-c", COMMAND, "train", "tracker", *line],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        with suppress(ProcessLookupError):  # the whole of it has ended
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stderr.close()


def wait_for_batches(process, out, count):
    """Waits until so many batches were learned from; the last may not be saved yet."""
    log, deadline = out / "progress.jsonl", time.monotonic() + LIMIT
    while not log.exists() or len(log.read_text().splitlines()) < count:
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.02)


def workers_of(process):
    """Process ids of the workers of a training."""
    return [
        pid
        for pid, found in processes().items()
        if found.parent == process.pid and "spawn_main" in found.command
    ]


def check_whole(out):
    """Checkpoint and policy can be read; returns the checkpoint's steps."""
    saved = read_checkpoint(out / "checkpoint.safetensors", "tracker")
    load_actor(out / "policy.safetensors", get_robot("go2"))
    return saved.state["steps"]


def test_a_killed_training_goes_on_from_its_last_checkpoint(train, tmp_path):
    out, figures = tmp_path / "run", tmp_path / "figures.json"
    first = train(out, "--workers=1", "--steps=50000")
    wait_for_batches(first, out, 3)
    workers = workers_of(first)
    first.send_signal(signal.SIGKILL)
    first.communicate(timeout=LIMIT)
    assert len(workers) == 1
    deadline = time.monotonic() + LIMIT
    while processes().keys() & set(workers):  # they notice that the trainer is gone
        assert time.monotonic() < deadline
        time.sleep(0.05)

    steps = check_whole(out)
    assert steps >= 2 * BATCH
    assert steps % BATCH == 0
    # What a training that is killed while it saves leaves behind.
    (out / ".checkpoint.x1y2.safetensors").write_bytes(b"half")
    resume = ("--workers=1", "--resume", f"--steps={steps + 2 * BATCH}")
    second = train(out, *resume, f"--json={figures}")
    _, error = second.communicate(timeout=LIMIT)
    assert second.returncode == 0, error
    assert check_whole(out) == steps + 2 * BATCH
    assert json.loads(figures.read_text())["steps"] == steps + 2 * BATCH
    assert not list(out.glob(".*"))
    # A batch is logged when the next begins, whole lines only.
    lines = (out / "progress.jsonl").read_text().splitlines()
    logged = {json.loads(line)["steps"] for line in lines}
    assert logged == set(range(BATCH, steps + 2 * BATCH, BATCH))


def test_a_killed_worker_costs_a_training_nothing(train, tmp_path):
    """Policies are those of a training that nobody disturbed, to the last bit."""
    outs = [tmp_path / name for name in ("calm", "disturbed")]
    for out in outs:
        process = train(out, "--workers=2", f"--steps={6 * BATCH}")
        if out == outs[1]:
            wait_for_batches(process, out, 2)
            workers = workers_of(process)
            assert len(workers) == 2
            os.kill(workers[1], signal.SIGKILL)
        _, error = process.communicate(timeout=LIMIT)
        assert process.returncode == 0, error
        assert error == ""
        assert check_whole(out) == 6 * BATCH
        assert not list(out.glob(".*"))
    calm, disturbed = ((out / "policy.safetensors").read_bytes() for out in outs)
    assert calm == disturbed
