"""The protocol of sources that fill a viewer's document: an edge, or a take on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from enliven.wire import Order
from enliven_viewer.playback.document import Document


class Feed(Protocol):
    """A source of characters, poses, bodies, cues and the edge's state for a document.

    ``EdgeFeed`` reads from an edge, ``TakeFeed`` from a file. Errors of the source never reach the caller:
    they become ``document.edge.message``.
    """

    def poll(self, document: Document) -> int:
        """Adds everything that has arrived since the last call to the document, without waiting.

        Returns the number of messages.
        """
        ...

    def ask(self, order: Order, then: Callable[[], None] | None = None) -> None:
        """Requests an order: possess, release, smooth, lock, look or browse.

        Args:
            then: called from a later :meth:`poll` after the order was executed.
        """
        ...

    def close(self) -> None:
        """Closes sockets, threads and files."""
        ...
