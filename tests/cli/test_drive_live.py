"""A drive by hand: a key pressed in a real browser moves the robot here."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from loco_drake.cli.main import main
from loco_drake.control.drive_file import load_drive
from loco_drake.systems.meshcat_driver import SLIDERS
from tests.browser import Browser, find_browser
from tests.process import HEAR_CTRL_C, LIMIT

FORWARD = SLIDERS[0][0]
SHOWN = "Array.from(document.querySelectorAll('.property-name div')).at(-1)?.innerHTML"

pytestmark = pytest.mark.slow


@pytest.fixture
def drive(tmp_path):
    """Starts the command in another process; returns it and the page's address."""
    processes = []

    def start(*arguments):
        call = f"{HEAR_CTRL_C}from loco_drake.cli.main import main; exit(main())"
        process = subprocess.Popen(
            [sys.executable, "-c", call, "drive", *arguments],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "LOCO_DRAKE_CACHE": str(tmp_path / "cache")},
        )
        processes.append(process)
        first = process.stdout.readline()
        assert first.startswith("Meshcat: http://"), process.stderr.read()
        return process, first.split()[1]

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.skipif(find_browser() is None, reason="needs Chromium, and there is none")
def test_keys_in_a_browser_drive_the_robot_and_the_page_shows_it(drive, tmp_path):
    # Without a graphics card drawing takes all of a machine's time.
    few = ("--overlay", "visualization: {publish_period: 0.125}")
    files = ("--record", "a.drive", "--json", "a.json")
    process, address = drive(*files, "--gait", "dog-trot", *few)
    with Browser(find_browser(), tmp_path / "profile", (320, 240)) as browser:
        browser.open(address)
        browser.wait_for(f"globalThis.viewer?.gui_controllers[{FORWARD!r}] != null")
        browser.evaluate("viewer.render = () => {}")
        browser.wait_for(f"{SHOWN}?.includes('command 0.00 and 0.00 m/s, 0.00 rad/s')")
        browser.press("KeyW", 6)
        browser.press("KeyD", 2)
        browser.press("KeyQ", 5)
        browser.wait_for(f"{SHOWN}?.includes('command 0.60 and -0.20 m/s, 0.50 rad/s')")
        browser.press("ArrowLeft")
        browser.press("KeyZ")
        browser.wait_for(f"{SHOWN}?.includes('dog-pace')")
        # Until it has gone a metre the page's world has moved by as much.
        world = "viewer.scene_tree.find(['drake']).object.position"
        browser.wait_for(f"Math.hypot({world}.x, {world}.y) > 1")
        browser.press("Space")
        browser.wait_for(f"{SHOWN}?.includes('command 0.00 and 0.00 m/s, 0.00 rad/s')")
        # A gamepad with its left stick at the front, which then is pulled out.
        pad = "{index: 0, connected: true, buttons: [], axes: [0, -1, 0, 0]}"
        browser.evaluate(f"navigator.getGamepads = () => [{pad}]")
        browser.wait_for(f"{SHOWN}?.includes('command 2.00 and 0.00 m/s')")
        browser.evaluate("navigator.getGamepads = () => []")
        browser.wait_for(f"{SHOWN}?.includes('command 0.00 and 0.00 m/s')")
        browser.wait_for(f"{SHOWN}?.includes('gamepad is gone')")
        browser.press("KeyR")
        browser.press("KeyX")
        browser.wait_for(f"{SHOWN}?.includes('dog-trot')")
        browser.press("KeyZ", 2)
        browser.wait_for(f"{SHOWN}?.includes('any: ')")
        browser.press("Escape")
        printed, error = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, error
    assert "normalized return" in printed
    rows = load_drive(tmp_path / "a.drive").table.rows
    for column, value in enumerate((0.6, -0.2, 0.5)):
        assert value in rows[:, column]
    assert rows[:, 0].max() == 2.0
    np.testing.assert_array_equal(rows[0], [0, 0, 0, 1, 0, 0])
    # Pace, trot again, and at last any.
    assert {-1, 0, 1} == set(rows[:, 3])
    assert rows[-1, 3] == -1
    assert (rows[:, 4].max(), rows[:, 5].max()) == (6.0, 1.0)
    figures = json.loads((tmp_path / "a.json").read_text())
    assert 0.02 < figures["speed_mps"] < 2.0
    # Without the page, and as fast as it goes, it is the same drive.
    line = ["drive", "--replay", str(tmp_path / "a.drive"), "--no-meshcat"]
    assert main([*line, "--json", str(tmp_path / "b.json")]) == 0
    assert json.loads((tmp_path / "b.json").read_text())["identical"] is True


@pytest.mark.skipif(find_browser() is None, reason="needs Chromium, and there is none")
@pytest.mark.parametrize("follow", [True, False])
def test_a_saved_replay_keeps_the_robot_in_the_middle(follow, tmp_path):
    """The robot's place on the page is its own and that of the world it is in."""
    page = tmp_path / "replay.html"
    line = ["simulate", "--no-meshcat", "--duration", "4", "--html", str(page)]
    command = ["--command", "0.8", "0", "0.5"]
    assert main([*line, *command, *([] if follow else ["--no-follow"])]) == 0
    place = (
        "(({x, y}) => Math.hypot(x, y))(['drake', 'illustration', 'go2', 'base']"
        ".map((_, k, path) => viewer.scene_tree.find(path.slice(0, k + 1)).object"
        ".position).reduce((a, b) => ({x: a.x + b.x, y: a.y + b.y})))"
    )
    with Browser(find_browser(), tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.wait_for("globalThis.viewer?.animator.duration > 0")
        browser.evaluate("viewer.animator.pause(); viewer.animator.seek(3.5)")
        if follow:
            assert browser.evaluate(place) < 0.05
        else:
            assert browser.evaluate(place) > 1.0


def test_ctrl_c_ends_a_drive_and_nothing_is_lost(drive, tmp_path):
    process, _ = drive("--record", "a.drive", "--json", "a.json", "--html", "a.html")
    assert "Ctrl-C ends" in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    printed, error = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, error
    assert "simulated" in printed
    record = load_drive(tmp_path / "a.drive")
    figures = json.loads((tmp_path / "a.json").read_text())
    assert figures["simulated_s"] == pytest.approx(record.header["steps"] * 0.02)
    assert "<html" in (tmp_path / "a.html").read_text()[:1000]
