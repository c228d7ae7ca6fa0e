"""A headless Chromium, driven through the pipes of its debugging protocol."""

import base64
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Without a sandbox, as containers require; WebGL by software.
OPTIONS = (
    "--headless=new",
    "--remote-debugging-pipe",
    "--no-sandbox",
    "--no-first-run",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
_LIMIT = 300.0  # s; a busy machine is slow


def find_browser() -> str | None:
    """Returns the path of a Chromium, if there is one."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """A page in a browser of its own.

    Args:
        program: a Chromium.
        folder: where it may write.
        size: width and height of the page, pixels.
    """

    def __init__(
        self, program: str, folder: Path, size: tuple[int, int] = (640, 480)
    ) -> None:
        # The browser reads commands at descriptor 3 and answers at 4.
        read, self._to = os.pipe()
        self._from, write = os.pipe()
        line = [
            program,
            *OPTIONS,
            f"--user-data-dir={folder}",
            f"--window-size={size[0]},{size[1]}",
            "about:blank",
        ]
        script = f'exec "$@" 3<&{read} 4>&{write}'
        self._process = subprocess.Popen(
            ["bash", "-c", script, "bash", *line],
            pass_fds=(read, write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(read)
        os.close(write)
        os.set_blocking(self._from, False)
        self._buffer = b""
        self._sent = 0
        self._session: dict[str, str] = {}

    def __enter__(self) -> Self:
        targets = self.call("Target.getTargets")["targetInfos"]
        (page,) = [t["targetId"] for t in targets if t["type"] == "page"]
        session = self.call("Target.attachToTarget", targetId=page, flatten=True)
        self._session = {"sessionId": session["sessionId"]}
        return self

    def __exit__(self, *error: object) -> None:
        self._process.terminate()
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._to)
        os.close(self._from)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Returns the browser's answer to a call of its protocol."""
        self._sent += 1
        message = {"id": self._sent, "method": method, "params": parameters}
        os.write(self._to, json.dumps({**message, **self._session}).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self._sent:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result

    def _receive(self) -> dict[str, Any]:
        deadline = time.monotonic() + _LIMIT
        while b"\0" not in self._buffer:
            assert self._process.poll() is None, "the browser has ended"
            assert time.monotonic() < deadline, "the browser does not answer"
            try:
                self._buffer += os.read(self._from, 2**20)
            except BlockingIOError:
                time.sleep(0.02)
        message, _, self._buffer = self._buffer.partition(b"\0")
        answer: dict[str, Any] = json.loads(message)
        return answer

    def open(self, address: str) -> None:
        """Opens a page."""
        self.call("Page.navigate", url=address)

    def evaluate(self, expression: str) -> Any:
        """Returns the value of a JavaScript expression in the page."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True
        )
        return answer["result"].get("value")

    def wait_for(self, expression: str) -> None:
        """Waits until a JavaScript expression is true in the page."""
        deadline = time.monotonic() + _LIMIT
        while not self.evaluate(expression):
            shown = self.evaluate("document.body.innerText.slice(-500)")
            assert time.monotonic() < deadline, f"{expression}: {shown}"
            time.sleep(0.1)

    def press(self, code: str, times: int = 1) -> None:
        """Presses a key, such as KeyW."""
        for _ in range(times):
            for kind in ("rawKeyDown", "keyUp"):
                self.call("Input.dispatchKeyEvent", type=kind, code=code)

    def screenshot(self, path: Path) -> None:
        """Saves what is seen as PNG."""
        picture = self.call("Page.captureScreenshot")["data"]
        path.write_bytes(base64.b64decode(picture))
