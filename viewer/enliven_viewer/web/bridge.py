"""The bridge between one edge and web pages: a viewer that forwards the edge's messages to the pages.

A thread reads from the edge, and passes the data to the thread of the web server. That thread puts the data
into the queue of each page. A page that joins late gets all characters, and the newest message of each kind.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from enliven.document import Character
from enliven.wire import (
    BODIES,
    BY_TYPE,
    CUES,
    POSE,
    PROPS,
    character_to_message,
    pack_payload,
    pack_stream,
    pack_topic,
)
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.web.page_queue import CHARACTER_PREFIX, Entry, PageQueue
from enliven_viewer.web.surfaces import pack_surface

_FORWARDED_TOPICS = (POSE, BODIES, CUES, PROPS)
"""Topics that the page shows."""
_MAX_WAIT_S = 0.02
"""Maximum time in seconds to wait for a message. The state and settling surfaces are checked at least this
often.
"""
_STATE_INTERVAL_S = 0.25
"""Seconds between two checks of the edge's state."""


class Bridge:
    """Follows one edge, and forwards its messages to pages.

    Args:
        address: address of the edge, which need not be running yet.
        loop: event loop of the web server, which uses the queues of the pages.
        on_failure: called from the thread of the bridge after an internal error.

    Attributes:
        failure: the internal error, or None.

    Raises:
        InputError: if the address is invalid, or a key file is damaged.
    """

    def __init__(
        self, address: str, loop: asyncio.AbstractEventLoop, on_failure: Callable[[], object]
    ) -> None:
        self._loop, self._on_failure = loop, on_failure
        self.failure: Exception | None = None
        self._received: dict[str, bytes] = {}
        self._link = EdgeClient([address], "web", forward=self._store_newest)
        self._surfaces = SolvedSurfaces()
        self._revisions: dict[str, tuple[int, Character]] = {}
        self._sent_surfaces: dict[str, Any] = {}
        self._state, self._check_state_at = "", 0.0
        self._listed = list[str]()
        self._pages: set[PageQueue] = set()
        self._newest: dict[str, bytes] = {}
        self._newest_state = json.dumps({"state": "waiting", "text": "", "edge": "", "characters": []})
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="web bridge", daemon=True)
        self._thread.start()

    @property
    def page_count(self) -> int:
        """Returns the number of connected pages."""
        return len(self._pages)

    def close(self) -> None:
        """Ends the thread, and closes the sockets to the edge."""
        self._stop.set()
        self._thread.join()

    @contextlib.contextmanager
    def join(self) -> Iterator[PageQueue]:
        """Yields the queue of a new page. The queue starts with the characters and the newest messages."""
        queue = PageQueue()
        queue.put_state(self._newest_state)
        queue.put(self._newest.items())
        self._pages.add(queue)
        try:
            yield queue
        finally:
            self._pages.discard(queue)

    # The following methods run in the thread of the web server.

    def _publish(self, entries: list[Entry], removed_ids: list[str], state: str) -> None:
        """Puts messages into the queues of all pages.

        Args:
            removed_ids: ids of removed characters.
            state: the new state as JSON, or empty.
        """
        for character in removed_ids:
            keys = [key for key in self._newest if key.partition(" ")[2] == character]
            for key in keys:
                del self._newest[key]
            for page in self._pages:
                page.forget(keys)
        self._newest.update(entries)
        if state:
            self._newest_state = state
        for page in self._pages:
            page.put(entries)
            if state:
                page.put_state(state)

    # The following methods run in the thread of the bridge.

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._link.wait(_MAX_WAIT_S)
                self._link.poll()
                self._forward_messages()
        except Exception as error:
            self.failure = error
            self._on_failure()
        finally:
            self._link.close()

    def _store_newest(self, message: Any) -> None:
        """Stores the newest message of each kind until the end of the poll."""
        topic = BY_TYPE[type(message)]
        if topic in _FORWARDED_TOPICS:
            self._received[f"{topic.name} {topic.key(message)}"] = pack_stream(message)

    def _forward_messages(self) -> None:
        """Passes all data that is new since the last call to the thread of the web server."""
        entries, removed_ids = self._find_characters()
        entries += self._received.items()
        self._received.clear()
        entries += self._solve_surfaces()
        state = self._find_state()
        if entries or removed_ids or state:
            # The loop is closed if the server has ended in the meantime.
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._publish, entries, removed_ids, state)

    def _find_characters(self) -> tuple[list[Entry], list[str]]:
        """Returns the messages of new and changed characters, and the ids of removed characters."""
        held_characters = self._link.edges[0].characters.held
        removed_ids = [name for name in self._revisions if name not in held_characters]
        for name in removed_ids:
            del self._revisions[name]
            self._sent_surfaces.pop(name, None)
        entries = list[Entry]()
        for name, held_character in held_characters.items():
            current = self._revisions.get(name)
            if (
                current is not None
                and current[0] == held_character.revision
                and current[1] is held_character.character
            ):
                continue
            self._revisions[name] = held_character.revision, held_character.character
            self._sent_surfaces.pop(name, None)
            payload = pack_payload(character_to_message(held_character.character, held_character.revision))
            entries.append((CHARACTER_PREFIX + name, pack_topic("character", payload)))
        if removed_ids:
            self._surfaces.keep_only(held_character.character for held_character in held_characters.values())
        return entries, removed_ids

    def _solve_surfaces(self) -> list[Entry]:
        """Returns the messages of the surfaces with control points that have moved."""
        self._link.take(POSE)  # Only the newest pose of each character is needed.
        entries = list[Entry]()
        for name, received in self._link.latest(POSE).items():
            character = received.character
            if not self._pages or character is None or character.kind != "points":
                continue
            vertices = self._surfaces.vertices(character, received.pose)
            if vertices is not None and vertices is not self._sent_surfaces.get(name):
                self._sent_surfaces[name] = vertices
                entries.append((f"surface {name}", pack_surface(name, received.revision, vertices)))
        return entries

    def _find_state(self) -> str:
        """Returns the edge's state as JSON if it has changed, otherwise an empty text."""
        now = time.monotonic()
        characters = sorted(self._revisions)
        if now < self._check_state_at and characters == self._listed:
            return ""
        self._check_state_at, self._listed = now + _STATE_INTERVAL_S, characters
        health, edge = next(iter(self._link.health.values())), self._link.edges[0]
        name = edge.status.edge if edge.status is not None else ""
        # Leave out the seconds of silence, because they would change the state all the time.
        text = f"{name} is silent" if health.state == "stale" else health.text
        state = json.dumps(
            {"state": health.state, "text": text, "edge": name, "characters": characters}, ensure_ascii=False
        )
        if state == self._state:
            return ""
        self._state = state
        return state
