"""The real program of an edge beside the test, on ports of its own."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from enliven.wire import BODIES, Topic, free_ports
from enliven_viewer.link import EdgeClient, EdgeFeed
from enliven_viewer.playback import Document


class RealEdge:
    """``enliven edge`` with the words of a command line; it is ended with :meth:`close`."""

    def __init__(self, *words: str) -> None:
        self.ports = [str(port) for port in free_ports()[:2]]
        own = ["--port", self.ports[0], "--control-port", self.ports[1], "--name", f"edge-{time.time_ns()}"]
        self.log = tempfile.NamedTemporaryFile("w+", suffix=".log")  # noqa: SIM115, it lives as long as the edge
        command = [str(Path(sys.executable).parent / "enliven"), "edge", *words, *own]
        self._process = subprocess.Popen(command, stderr=self.log, stdout=self.log)

    @property
    def address(self) -> str:
        """HOST:PORT:CONTROL_PORT."""
        return ":".join(["127.0.0.1", *self.ports])

    def wait(self, seconds: float = 300.0) -> None:
        """Return once a performer and a character are heard from it; films need no pictures of its start.

        It listens long before: its kernels may have to be compiled for the first frame.

        Raises:
            TimeoutError: where nobody is seen in so long.
        """
        end, performers = time.monotonic() + seconds, list[int]()

        def heard(topic: Topic, value: Any) -> None:
            if topic is BODIES:
                performers[:] = [body.id for body in value.bodies]

        document, feed = Document(), EdgeFeed(EdgeClient([self.address], "film"))
        feed.heard = heard
        with contextlib.closing(feed):
            while time.monotonic() < end:
                feed.poll(document)
                if performers and document.characters:
                    return
                time.sleep(0.05)
        raise TimeoutError(f"nobody is seen by the edge at {self.address}")

    def close(self) -> None:
        """End it as Ctrl-C does, or at once where it does not."""
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
