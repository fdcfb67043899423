"""Runs the real edge program in the background, on its own ports."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from enliven.wire import BODIES, Topic, free_ports
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.playback.document import Document


class RealEdge:
    """An ``enliven edge`` process with the given arguments. Call :meth:`close` to end it."""

    def __init__(self, *words: str) -> None:
        self.ports = [str(port) for port in free_ports()[:2]]
        own = ["--port", self.ports[0], "--control-port", self.ports[1], "--name", f"edge-{time.time_ns()}"]
        self.log = tempfile.NamedTemporaryFile("w+", suffix=".log")  # noqa: SIM115, it lives as long as the edge
        command = [str(Path(sys.executable).parent / "enliven"), "edge", *words, *own]
        self._process = subprocess.Popen(command, stderr=self.log, stdout=self.log)

    @property
    def address(self) -> str:
        """Returns HOST:PORT:CONTROL_PORT."""
        return ":".join(["127.0.0.1", *self.ports])

    def wait(self, seconds: float = 300.0) -> None:
        """Waits until the edge sends a performer and a character, so that films do not show its start.

        The edge listens earlier, but it may have to compile its kernels for the first frame.

        Raises:
            TimeoutError: if no performer appears in time.
        """
        end, performers = time.monotonic() + seconds, list[int]()

        def heard(topic: Topic, value: Any) -> None:
            if topic is BODIES:
                performers[:] = [body.id for body in value.bodies]

        document, feed = Document(), EdgeFeed(EdgeClient([self.address], "film"))
        feed.on_message = heard
        with contextlib.closing(feed):
            while time.monotonic() < end:
                feed.poll(document)
                if performers and document.characters:
                    return
                time.sleep(0.05)
        raise TimeoutError(f"nobody is seen by the edge at {self.address}")

    def close(self) -> None:
        """Ends the process with SIGINT, like Ctrl-C, or kills it if that fails."""
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
