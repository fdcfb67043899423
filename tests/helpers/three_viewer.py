"""Renders GLB files with three.js in headless Chromium, which shares no code with enliven."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import threading
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
THREE = Path(os.environ.get("ENLIVEN_THREE", FOLDER.parents[1] / "out" / "web" / "node_modules" / "three"))
"""The folder of the npm package three, which `make test-web` fetches."""
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
MISSING_REASON = (
    "Chromium is not installed"
    if CHROMIUM is None
    else ""
    if (THREE / "build" / "three.module.js").is_file()
    else "three.js is not here: make test-web"
)
"""The reason why no image can be rendered; empty if everything is installed."""
CHROMIUM_OPTIONS = [
    "--headless=new",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
]
"""Options of headless Chromium with WebGL on the CPU."""
_TIMEOUT_S = 120.0
"""Timeout for all images, seconds. Chromium starts in 2 s, and each image takes less than a second on an idle
machine."""
_KINDS = {".html": "text/html", ".js": "text/javascript"}


@dataclass(frozen=True)
class Job:
    """An image to render.

    Attributes:
        glb: the file.
        clip_from_world: (4, 4) the camera.
        size: width and height in pixels.
        seconds: time of its animations; None for the file at rest.
    """

    glb: bytes
    clip_from_world: np.ndarray
    size: tuple[int, int]
    seconds: float | None = None


def render_jobs(jobs: list[Job], folder: Path) -> list[np.ndarray]:
    """Returns (H, W, 4) uint8 of each job, top row first; the background has opacity 0.

    Args:
        folder: folder for the files of Chromium.

    Raises:
        AssertionError: if the page reports an error or does not finish in time.
    """
    pictures: dict[int, bytes] = {}
    ended, errors = threading.Event(), list[str]()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            data, kind = _serve_file(self.path, jobs)
            self.send_response(404 if data is None else 200)
            self.send_header("Content-Type", kind)
            self.end_headers()
            self.wfile.write(data or b"")

        def do_POST(self) -> None:
            data = self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200)
            self.end_headers()
            if self.path == "/end":
                errors.append(data.decode())
                ended.set()
            else:
                pictures[int(self.path.rpartition("/")[2])] = data

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_port}/three_page.html"
    own = [CHROMIUM, *CHROMIUM_OPTIONS, f"--user-data-dir={folder}", "--remote-debugging-port=0", address]
    browser = subprocess.Popen(
        own, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        assert ended.wait(_TIMEOUT_S), f"{len(pictures)} of {len(jobs)} pictures came in time"
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(browser.pid, signal.SIGKILL)
        browser.wait()
        server.shutdown()
        server.server_close()
    assert errors == [""], errors[0]
    return [
        np.frombuffer(pictures[number], np.uint8).reshape(*job.size[::-1], 4)[::-1]
        for number, job in enumerate(jobs)
    ]


def _serve_file(path: str, jobs: list[Job]) -> tuple[bytes | None, str]:
    """Returns the bytes and the type of a URL; None instead of bytes for an unknown URL."""
    if path == "/jobs":
        listed = [
            {
                "clip_from_world": job.clip_from_world.T.ravel().tolist(),
                "size": job.size,
                "seconds": job.seconds,
            }
            for job in jobs
        ]
        return json.dumps(listed).encode(), "application/json"
    if path.startswith("/file/"):
        return jobs[int(Path(path).stem)].glb, "model/gltf-binary"
    file = THREE / path.removeprefix("/three/") if path.startswith("/three/") else FOLDER / path.lstrip("/")
    kind = _KINDS.get(file.suffix, "application/octet-stream")
    return (file.read_bytes() if file.is_file() else None), kind
