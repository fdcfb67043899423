"""Stores the addresses of edges to which the window was connected, newest first."""

from __future__ import annotations

import contextlib
from pathlib import Path

from enliven.files import user_data_folder

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
