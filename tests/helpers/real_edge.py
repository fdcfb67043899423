"""The real program of an edge beside the test, on ports of its own."""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from enliven.wire import free_ports


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

    def wait(self, seconds: float = 180.0) -> None:
        """Return once it listens; films need no pictures of its start.

        Raises:
            TimeoutError: where it does not listen in so long.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with socket.socket() as trial:
                if trial.connect_ex(("127.0.0.1", int(self.ports[0]))) == 0:
                    return
            time.sleep(0.2)
        raise TimeoutError(f"no edge listens at {self.address}")

    def close(self) -> None:
        """End it as Ctrl-C does, or at once where it does not."""
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
