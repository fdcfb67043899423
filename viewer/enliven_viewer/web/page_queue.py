"""The queue of messages for one page. It contains only the newest message of each kind and character."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

import msgspec

_MAX_UNANSWERED = 2
"""Maximum number of sent batches that the page has not drawn yet. The page draws one batch while the next is
in transit.
"""
_ENCODER = msgspec.msgpack.Encoder()

Entry = tuple[str, bytes]
"""A key and the bytes of a message. A later message replaces an earlier one with the same key."""
CHARACTER_PREFIX = "0 "
"""Prefix of the keys of characters. A batch is sorted by key, so that characters precede their poses."""


class PageQueue:
    """Messages for one page. A slow page gets fewer messages, but always the newest.

    Attributes:
        sent_bytes: total size in bytes of all batches since the start.
    """

    def __init__(self) -> None:
        self._pending: dict[str, bytes] = {}
        self._state: str | None = None
        self._sent = self._answered = 0
        self._ready = asyncio.Event()
        self.sent_bytes = 0

    def put(self, entries: Iterable[Entry]) -> None:
        """Adds messages, which replace those with the same keys."""
        self._pending.update(entries)
        self._update()

    def put_state(self, state: str) -> None:
        """Sets the state of the edge as JSON. It is sent even while batches are unanswered."""
        self._state = state
        self._update()

    def forget(self, keys: Iterable[str]) -> None:
        """Removes messages of removed characters."""
        for key in keys:
            self._pending.pop(key, None)

    def answer(self, number: int) -> None:
        """Handles the page's answer that it has drawn all batches up to ``number``."""
        self._answered = max(self._answered, min(number, self._sent))
        self._update()

    async def next(self) -> str | bytes:
        """Waits for the next message to the page: a state as text, or a batch of messages."""
        await self._ready.wait()
        if self._state is not None:
            state, self._state = self._state, None
            self._update()
            return state
        batch = [self._pending[key] for key in sorted(self._pending)]
        self._pending.clear()
        self._sent += 1
        self._update()
        data = _ENCODER.encode([self._sent, batch])
        self.sent_bytes += len(data)
        return data

    def _update(self) -> None:
        may_send = self._sent - self._answered < _MAX_UNANSWERED
        if self._state is not None or (self._pending and may_send):
            self._ready.set()
        else:
            self._ready.clear()
