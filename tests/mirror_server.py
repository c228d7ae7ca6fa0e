"""A web server on the loopback interface that serves a folder, and can misbehave."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote


class MirrorServer(ThreadingHTTPServer):
    """Serves the files of a folder and remembers what was asked for.

    Attributes:
        asked: the paths of all requests, without the first slash.
        cut: paths of which half is sent, under the full length, then nothing.
        stalled: paths of which half is sent, and the rest only once ``go_on`` is set.
        halfway: is set when half of a stalled file has been sent.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.folder = folder
        self.asked: list[str] = []
        self.cut: set[str] = set()
        self.stalled: set[str] = set()
        self.halfway = threading.Event()
        self.go_on = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class _Handler(BaseHTTPRequestHandler):
    server: MirrorServer

    def do_GET(self) -> None:
        name = unquote(self.path).removeprefix("/")
        self.server.asked.append(name)
        path = self.server.folder / name
        if not path.is_file():
            self.send_error(404)
            return
        content = path.read_bytes()
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        half = len(content) // 2
        self.wfile.write(content[:half])
        if name in self.server.cut:
            return
        if name in self.server.stalled:
            self.server.halfway.set()
            self.server.go_on.wait(60)
            return
        self.wfile.write(content[half:])

    def log_message(self, *args: object) -> None:
        pass


@contextmanager
def serve(folder: Path) -> Iterator[MirrorServer]:
    """Yields a server of ``folder`` on a free port; it has ended after the block."""
    with MirrorServer(folder) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.go_on.set()
            server.shutdown()
            thread.join()
