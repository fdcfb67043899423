"""The addresses of edges that the window was connected to, the newest first."""

from __future__ import annotations

import contextlib
from pathlib import Path

from enliven.files import own_folder

_KEPT = 6
"""Addresses that are remembered: a list that is read at a glance."""


class Addresses:
    """A small file of addresses.

    Args:
        folder: where it is; None takes the user's own place.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._known: tuple[str, ...] | None = None

    @property
    def known(self) -> tuple[str, ...]:
        """Returns the addresses, the newest first; read once."""
        if self._known is None:
            self._known = ()
            with contextlib.suppress(OSError, UnicodeDecodeError):
                self._known = tuple(self._path.read_text("utf-8").split()[:_KEPT])
        return self._known

    def remember(self, address: str) -> None:
        """Puts an address first."""
        kept = (address, *(one for one in self.known if one != address))[:_KEPT]
        self._known = kept
        with contextlib.suppress(OSError):  # to be connected matters more than to remember it
            self._path.write_text("\n".join(kept) + "\n", "utf-8")

    @property
    def _path(self) -> Path:
        return (self._folder or own_folder()) / "edges.txt"
