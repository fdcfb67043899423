"""The protocol of sources that fill a viewer's document: an edge, or a take on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from enliven.wire import Order
from enliven_viewer.playback import Document


class Feed(Protocol):
    """Brings characters, poses, bodies, cues and the edge's state into a document.

    ``EdgeFeed`` does so from an edge, ``Take``
    from a file.
    Errors of a peer never reach the caller: they become ``document.edge.message``.
    """

    def poll(self, document: Document) -> int:
        """Applies what has arrived since the last call, without waiting; 0 if nothing had."""
        ...

    def ask(self, order: Order, then: Callable[[], None] | None = None) -> None:
        """Asks for an order to be carried out: to possess, release, smooth, lock, look or browse.

        Args:
            then: called from a later :meth:`poll` once it was.
        """
        ...

    def close(self) -> None:
        """Lets sockets, threads and files go."""
        ...
