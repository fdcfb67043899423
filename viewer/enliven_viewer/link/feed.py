"""The protocol of sources that fill a viewer's document: an edge, or a take on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from enliven.wire import Look, Mode
from enliven_viewer.playback import Document


class Feed(Protocol):
    """Brings characters, poses, bodies, cues and the edge's state into a document.

    ``EdgeFeed`` does so from an edge, ``Take``
    from a file.
    Errors of a peer never reach the caller: they become ``document.edge.message``.
    """

    def poll(self, document: Document) -> int:
        """Apply what has arrived since the last call, without waiting; 0 where nothing had."""
        ...

    def possess(
        self, character_id: str, body: int | None = None, parts: str = "all", mode: Mode = "alone"
    ) -> None:
        """Ask for a performer to possess a character.

        Args:
            body: the performer's id; None: the performer in view.
            parts: what of the body, as in :data:`enliven.person.body.PARTS`.
            mode: who else holds it then; "preview": only show what would be held.
        """
        ...

    def release(self, character_id: str, body: int | None = None) -> None:
        """Ask for a character to be released by a performer, or by every performer."""
        ...

    def smooth(self, body: int, amount: float | None = None) -> None:
        """Ask for an amount of smoothing of a performer: 0 for none, None for the edge's settings."""
        ...

    def lock(self, on: bool, then: Callable[[], None]) -> None:
        """Ask that only the performers who are followed now perform, or with False all who come.

        Args:
            then: called from a later :meth:`poll` once it is so.
        """
        ...

    def look(self, look: Look) -> None:
        """Tell the edge the direction of view, since matches are ranked as they are seen on the screen."""
        ...

    def browse(self, character_id: str, step: int = 1) -> None:
        """Ask for another match of a character to be shown: so many places on in the ranking."""
        ...

    def close(self) -> None:
        """Let sockets, threads and files go."""
        ...
