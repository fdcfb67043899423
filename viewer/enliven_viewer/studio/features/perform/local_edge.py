"""An edge on this machine, and the addresses of edges that were used before."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path

from enliven.commands.processes import start_process
from enliven.errors import ResourceError
from enliven.files import user_data_folder
from enliven.wire import Endpoint, free_ports
from enliven_viewer.language import tr

_MAX_ADDRESSES = 6
"""Maximum number of stored addresses. A longer list would be hard to read."""


class Addresses:
    """A file with the most recently used addresses.

    Args:
        folder: folder of the file. None means the user's own data folder.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._addresses: tuple[str, ...] | None = None

    @property
    def addresses(self) -> tuple[str, ...]:
        """Returns the addresses, newest first. The file is read only once."""
        if self._addresses is None:
            self._addresses = ()
            with contextlib.suppress(OSError, UnicodeDecodeError):
                self._addresses = tuple(self._path.read_text("utf-8").split()[:_MAX_ADDRESSES])
        return self._addresses

    def remember(self, address: str) -> None:
        """Moves an address to the top."""
        addresses = (address, *(other for other in self.addresses if other != address))[:_MAX_ADDRESSES]
        self._addresses = addresses
        with contextlib.suppress(OSError):  # A failure to store the address must not prevent the connection.
            self._path.write_text("\n".join(addresses) + "\n", "utf-8")

    @property
    def _path(self) -> Path:
        return (self._folder or user_data_folder()) / "edges.txt"


_CLOSE_TIMEOUT_S = 5.0
"""Seconds that an ending edge may take to close its sensor before it is killed."""


class LocalEdge:
    """One edge as a child process.

    Args:
        arguments: command line arguments, such as "--sensor", "synthetic".

    Attributes:
        endpoint: address on which the edge will listen.

    Raises:
        ResourceError: if the edge's program is not installed.
    """

    def __init__(self, *arguments: str) -> None:
        if find_spec("enliven_edge") is None:
            remedy = tr(
                "Install the camera program: pip install enliven-edge. Or connect to a camera on another "
                "computer."
            )
            raise ResourceError(tr("the camera program is not installed here"), where="stage", remedy=remedy)
        pose, control = free_ports()[:2]
        self.endpoint = Endpoint("127.0.0.1", pose, control)
        ports = ("--port", str(pose), "--control-port", str(control), "--name", f"window-{os.getpid()}")
        self._log = tempfile.TemporaryFile("w+")  # noqa: SIM115, it must live as long as the edge
        self._process = start_process(["edge", *arguments, *ports], stderr=self._log)

    @property
    def ended(self) -> str | None:
        """Returns the last line of the edge's output if the edge has ended, as the reason, or None while it
        runs.
        """
        if self._process.poll() is None:
            return None
        self._log.seek(0)
        lines = [line.strip() for line in self._log.read().splitlines() if line.strip()]
        return lines[-1] if lines else tr("the camera program has ended")

    def close(self) -> None:
        """Ends the process."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(_CLOSE_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._log.close()


def start_replay(recording: Path | None) -> LocalEdge:
    """Returns an edge that plays a recording in a loop, by default the bundled recording."""
    return LocalEdge("--loop", *(("--recording", str(recording)) if recording else ()))
