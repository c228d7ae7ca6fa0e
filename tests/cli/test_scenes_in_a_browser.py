"""What a page shows, from its pixels: the robot on the ground, wherever it has gone."""

import os
import pty
import signal
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from loco_drake.cli import drive
from loco_drake.cli.main import main
from loco_drake.cli.simulation import start_meshcat
from loco_drake.control.state import POSITION
from loco_drake.motion.motion_file import save_motion
from tests.browser import Browser, find_browser
from tests.process import HEAR_CTRL_C, LIMIT
from tests.synthetic_motion import synthetic_motion

SIZE = (640, 480)
CAPTION = "document.querySelector('.caption').innerText"
SUN = "viewer.scene_tree.find(['Lights', 'FillLight', '<object>']).object"
WORLD = "viewer.scene_tree.find(['drake']).object.position"
# A gallop, and what it changes to at the end.
TABLE = """time,forward,sideways,yaw_rate,gait
0,1.0,0,0.1,dog-gallop
30.2,1.0,0,0.1,dog-trot
"""
GALLOP, CHANGE = (1.0, 5.0, 30.0), 31.5  # s

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_browser() is None, reason="needs Chromium"),
]


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    folder = tmp_path_factory.mktemp("profile")
    with Browser(find_browser(), folder, SIZE) as browser:
        yield browser


def open_page(browser, address):
    """Opens a page that is drawn for pictures only: without a graphics card it takes
    all of a machine's time.
    """
    browser.open(address)
    browser.wait_for("globalThis.viewer?.renderer != null")
    browser.evaluate("viewer.paint = viewer.render; viewer.render = () => {}")


@pytest.fixture
def picture(browser, tmp_path):
    """Takes pictures of the page, after a change that is written in JavaScript."""

    def take(change=""):
        frame = "new Promise((done) => requestAnimationFrame(() => {{ {}; done() }}))"
        for step in (f"{change}; viewer.paint()", ""):
            drawn = frame.format(step)
            browser.call("Runtime.evaluate", expression=drawn, awaitPromise=True)
        browser.screenshot(tmp_path / "a.png")
        with Image.open(tmp_path / "a.png") as image:
            return np.array(image.convert("RGB")).astype(int)

    return take


@pytest.fixture
def look(picture):
    """Checks that a page shows a robot on ground, in light; returns the picture."""

    def check(name):
        def show(*path, visible):
            return (
                f"viewer.scene_tree.find({['drake', *path]}).object.visible = {visible}"
            )

        beside = [("plan",), ("contact_forces",)]
        lit = picture("; ".join(show(*path, visible="false") for path in beside))
        plain = picture(f"{SUN}.castShadow = false")
        robot = ("illustration", name)
        empty = picture(show(*robot, visible="false"))
        shown = "; ".join(show(*path, visible="true") for path in (*beside, robot))
        whole = picture(f"{SUN}.castShadow = true; {shown}")
        seen = np.abs(plain - empty).max(axis=-1) > 25
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(0))
        height, width = seen.shape
        assert len(columns) > width / 10
        assert abs(np.median(columns) - width / 2) < width / 8
        assert rows[-1] - rows[0] > height / 20
        # Where the feet are there is floor from side to side: grey, and not sky, which
        # is bluer; and it is as light as in the front.
        floor = empty[rows[-1]]
        assert np.abs(floor - np.median(empty[-20:], axis=(0, 1))).max() < 60
        bluer = empty[..., 2] - empty[..., 0]
        assert bluer[rows[-1]].max() < 20
        # So it is 30 m away, a little below the horizon.
        assert bluer[round(0.34 * height), 3 * width // 4 :].max() < 20
        assert bluer[height // 8, -width // 8] > 25
        # The shadow is beside the feet.
        shadow = (plain - lit).min(axis=-1) > 15
        assert shadow[:, columns[0] : columns[-1]].sum() > 200
        assert abs(np.flatnonzero(shadow.any(axis=1))[-1] - rows[-1]) < height / 10
        return whole

    return check


def marked(picture):
    """Returns whether the page's title stands out in orange."""
    corner = picture[:40, 90:400]
    return (np.abs(corner - [208, 64, 0]).max(axis=-1) < 20).sum() > 1000


@pytest.mark.parametrize("robot", ["go2", "a1"])
def test_a_gallop_of_half_a_minute_stays_in_the_picture_live_and_saved(
    robot, browser, look, tmp_path, monkeypatch
):
    pages, shown = [], []

    def start(port, *, announce):
        meshcat = start_meshcat(port, announce=announce)
        pages.append(meshcat)
        open_page(browser, meshcat.web_url())
        return meshcat

    class Looks:
        """Stands for what waits for the clock after each control period."""

        elapsed = 0.0

        def __init__(self, recorder, waits):
            self.recorder = recorder

        def keep(self, now):
            if now not in (*GALLOP, CHANGE):
                return
            context = self.recorder.context
            x, y, _ = self.recorder.diagram.GetOutputPort("state").Eval(context)[
                POSITION
            ]
            pages[0].Flush()
            browser.wait_for(f"Math.hypot({WORLD}.x + {x}, {WORLD}.y + {y}) < 1e-3")
            browser.wait_for(f"{CAPTION}.includes('{now:.1f} s')")
            shown.append((now, np.hypot(x, y), look(robot), browser.evaluate(CAPTION)))

    monkeypatch.setattr(drive, "start_meshcat", start)
    monkeypatch.setattr(drive, "Pace", Looks)
    table, page = tmp_path / "commands.csv", tmp_path / "a.html"
    table.write_text(TABLE)
    line = ["drive", "--robot", robot, "--commands", str(table), "--html", str(page)]
    few = [
        "--gait",
        "dog-gallop",
        "--overlay",
        "visualization: {publish_period: 0.125}",
    ]
    assert main([*line, *few, "--duration", str(CHANGE)]) == 0
    assert page.stat().st_size < 10e6
    assert [now for now, *_ in shown] == [*GALLOP, CHANGE]
    # Beyond the tiles of the floor, which end 15 m from their middle.
    assert shown[2][1] > 15
    open_page(browser, page.as_uri())
    browser.wait_for("globalThis.viewer?.animator.duration > 31")
    browser.evaluate("viewer.animator.pause()")
    for now, _, _, caption in list(shown):
        browser.evaluate(f"viewer.animator.seek({now})")
        browser.wait_for(f"{CAPTION}.includes('{now:.1f} s')")
        assert browser.evaluate(CAPTION) == caption
        shown.append((now, None, look(robot), caption))
    for now, _, picture, caption in shown:
        title = "dog-gallop → dog-trot" if now == CHANGE else "dog-gallop"
        assert caption.splitlines()[0] == title
        assert "return" in caption
        assert "plan: ● front toes ● rear toes ● withers and hip" in caption
        assert marked(picture) == (now == CHANGE)


def test_simulate_keeps_the_page_and_its_replay_until_ctrl_c(browser, look, tmp_path):
    save_motion(synthetic_motion("dog-trot", 1.5, 0.5), tmp_path / "a.npz")
    call = f"{HEAR_CTRL_C}from loco_drake.cli.main import main; exit(main())"
    line = ["simulate", "--reference", "a.npz", "--forces", "--html", "a.html"]
    terminal, end = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", call, *line],
        cwd=tmp_path,
        stdin=end,
        stdout=end,
        stderr=subprocess.PIPE,
    )
    os.close(end)
    try:
        with os.fdopen(terminal) as output:
            address = next(row for row in output if row.startswith("Meshcat: "))
            assert any("until Ctrl-C" in row for row in output)
            saved = (tmp_path / "a.html").as_uri()
            for page in (address.split()[1], saved):
                open_page(browser, page)
                browser.wait_for("globalThis.viewer?.animator.duration > 1")
                check_replay(browser)
                look("go2")
            process.send_signal(signal.SIGINT)
            assert process.wait(LIMIT) == 0, process.stderr.read()
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


def test_a_robot_far_from_the_origin_still_has_a_shadow(browser, picture, tmp_path):
    """On a page whose camera stays, too."""
    motion, page = tmp_path / "a.npz", tmp_path / "a.html"
    save_motion(synthetic_motion(seconds=5.0, speed=1.4), motion)
    line = ["simulate", "--no-meshcat", "--no-follow", "--reference", str(motion)]
    assert main([*line, "--html", str(page)]) == 0
    open_page(browser, page.as_uri())
    browser.wait_for("globalThis.viewer?.animator.duration > 4")
    browser.evaluate("viewer.animator.pause(); viewer.animator.seek(4.8)")
    lit = picture()
    plain = picture(f"{SUN}.castShadow = false")
    shadow = (plain - lit).min(axis=-1) > 15
    assert shadow.sum() > 30
    # The picture shows the whole way, and at its end the robot and its shadow.
    across = np.flatnonzero(shadow.any(axis=0))
    assert SIZE[0] / 2 < np.median(across) < SIZE[0]
    assert np.ptp(across) < SIZE[0] / 4


def check_replay(browser):
    """It goes round as a whole, and the corner says what belongs to its time."""
    actions = "viewer.animator.actions"
    browser.wait_for(f"{CAPTION}.includes('contact forces, 1 cm for 5 N')")
    lengths = f"{actions}.map((action) => action.getClip().duration)"
    assert len(set(browser.evaluate(lengths))) == 1
    # Faster, until it has begun again twice.
    browser.evaluate("viewer.animator.mixer.timeScale = 4")
    browser.wait_for(f"Math.min(...{actions}.map((a) => a._loopCount)) >= 2")
    browser.evaluate("viewer.animator.pause(); viewer.animator.seek(1)")
    browser.wait_for(f"{CAPTION}.startsWith('dog-trot') && {CAPTION}.includes('1.0 s')")
    arrows = "viewer.scene_tree.find(['drake', 'contact_forces', 'point']).children"
    assert browser.evaluate(f"Object.keys({arrows}).length") >= 4
    for folder in ("FL", "RR"):
        assert f"{folder}_calf" in browser.evaluate(f"Object.keys({arrows}).join()")
