"""A player by hand: keys pressed in a real browser stop and step the motion."""

import subprocess
import sys

import pytest

from loco_drake.motion.motion_file import save_motion
from tests.browser import Browser, find_browser
from tests.process import HEAR_CTRL_C, LIMIT
from tests.synthetic_motion import synthetic_motion

SHOWN = "Array.from(document.querySelectorAll('.property-name div')).at(-1)?.innerHTML"


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason="needs Chromium, and there is none")
def test_keys_in_a_browser_stop_and_step_the_motion(tmp_path):
    names = ("a.npz", "b.npz")
    for name in names:
        save_motion(synthetic_motion(seconds=60.0, speed=0.3), tmp_path / name)
    call = f"{HEAR_CTRL_C}from loco_drake.cli.main import main; exit(main())"
    process = subprocess.Popen(
        [sys.executable, "-c", call, "play", *names],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        address = next(line for line in process.stdout if line.startswith("Meshcat: "))
        with Browser(find_browser(), tmp_path / "profile", (320, 240)) as browser:
            browser.open(address.split()[1])
            browser.wait_for("globalThis.viewer?.gui_controllers['frame'] != null")
            browser.evaluate("viewer.render = () => {}")
            browser.press("ArrowDown")
            browser.wait_for(f"{SHOWN}?.includes('2 of 2: dog-trot  b.npz')")
            browser.press("Space")
            browser.wait_for(f"{SHOWN}?.includes('paused')")
            frame = "Number(" + SHOWN + ".match(/frame (\\d+)/)[1])"
            before = browser.evaluate(frame)
            browser.press("ArrowRight", 3)
            browser.wait_for(f"{frame} == {before + 3}")
            browser.press("ArrowLeft")
            browser.wait_for(f"{frame} == {before + 2}")
            browser.press("ArrowUp")
            browser.wait_for(f"{SHOWN}?.includes('1 of 2: dog-trot  a.npz')")
            browser.press("Escape")
            _, error = process.communicate(timeout=LIMIT)
        assert process.returncode == 0, error
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()
