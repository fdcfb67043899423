"""Puts characters on the stage of an edge: packed beside the pictures, sent in parts, each content once."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from enliven.document import Project
from enliven.errors import EnlivenError
from enliven.formats.project import character_bytes
from enliven.wire import (
    MAX_PART_BYTES,
    MAX_SENT_BYTES,
    MAX_TEXTURE_BYTES,
    Answer,
    Ask,
    Awaited,
    CharacterPart,
    Done,
    PutCharacter,
    Refused,
    RemoveCharacter,
)

_PARTS_UNDER_WAY = 8
"""Parts that wait for their answers: 15 MB a second where an edge answers at each of 30 frames per second."""
_ASK_AGAIN = 0.03
"""Seconds between two questions whether a character stands on the stage: about a frame."""
_ANSWER_WITHIN = 5.0
"""Seconds after which a request is given up: an edge answers within a frame, a busy one within some."""
_MOST_RESTARTS = 20
"""Refused parts in one sending, such as after too many requests a second, before it is given up."""
_PAUSE = 0.25
"""Seconds before a sending goes on after a part was refused: an edge counts requests by the second."""

Then = Callable[[Answer], None]


def _packed(project: Project, character: str) -> bytes:
    """Returns the bytes of a character, with its textures where the wire carries them back from the edge."""
    data = character_bytes(project, character, MAX_TEXTURE_BYTES)
    return data if len(data) <= MAX_SENT_BYTES else character_bytes(project, character)


class StagedEdge(Protocol):
    """What a :class:`StageLink` needs of the link to an edge."""

    def request(self, body: Ask, seconds: float, on_reply: Callable[[Answer | None], None]) -> bool:
        """Sends a request; calls back with the answer, or None when the time is up; False without an edge."""

    def revision(self, character: str) -> int:
        """Returns the revision that the edge says it has; 0 for none."""


@dataclass
class _Sending:
    """A character on its way.

    Attributes:
        packed: its data, once it is there.
        sent: bytes that were handed over.
        under_way: parts that wait for their answers.
        ask_at: monotonic second of the next question, infinite while parts are under way.
        refused: whether one of these was refused: no more are sent before the next question.
    """

    name: str
    fit: bool
    then: Then
    packed: Future[bytes]
    order: PutCharacter | None = None
    data: bytes = b""
    sent: int = 0
    under_way: int = 0
    ask_at: float = 0.0
    refused: bool = False
    restarts: int = 0


class StageLink:
    """The stage of one edge; :meth:`poll` it as often as the link.

    A character that is put while an earlier revision of it is still on its way waits for that, and only the
    newest of those that wait is sent.
    """

    def __init__(self, edge: StagedEdge) -> None:
        self._edge = edge
        self._packer: ThreadPoolExecutor | None = None
        self._sending: dict[str, _Sending] = {}
        self._next: dict[str, Callable[[], None]] = {}
        self._last: dict[str, int] = {}

    @property
    def busy(self) -> bool:
        """Returns True if a character is on its way."""
        return bool(self._sending)

    def put(
        self, project: Project, character: str, *, name: str = "", fit: bool = False, then: Then | None = None
    ) -> None:
        """Puts a character of a project on the stage, or in the place of the one with its id.

        Args:
            name: its id on the stage; empty: as in the project.
            fit: whether a possessed mesh is first brought to a person's size, as a mesh from a file is.
            then: called from a later :meth:`poll` with Done once it stands there, else with Refused.
        """
        name, then = name or character, then or (lambda answer: None)
        if name in self._sending:
            self._next[name] = partial(self.put, project, character, name=name, fit=fit, then=then)
            return
        if self._packer is None:
            self._packer = ThreadPoolExecutor(1, "packer")
        packed = self._packer.submit(_packed, project, character)
        self._sending[name] = _Sending(name, fit, then, packed)

    def remove(self, character: str, then: Then | None = None) -> None:
        """Takes a character from the stage."""
        told = then or (lambda answer: None)
        self._ask(RemoveCharacter(character), told)

    def poll(self) -> None:
        """Goes on with what is on its way; returns at once."""
        now = time.monotonic()
        for sending in list(self._sending.values()):
            if sending.order is None and sending.packed.done():
                self._announce(sending)
            if sending.order is not None and now >= sending.ask_at:
                sending.ask_at = float("inf")
                self._ask(sending.order, partial(self._told, sending))

    def restart(self) -> None:
        """Forgets the revisions of an edge that was started again: it counts from the beginning."""
        self._last.clear()

    def close(self) -> None:
        """Ends the packing."""
        if self._packer is not None:
            self._packer.shutdown(wait=False, cancel_futures=True)

    def _announce(self, sending: _Sending) -> None:
        """Makes the order of a character that is packed."""
        try:
            sending.data = sending.packed.result()
        except EnlivenError as error:
            self._end(sending, Refused(str(error)[:400]))
            return
        size, digest = len(sending.data), hashlib.sha256(sending.data).digest()
        if size > MAX_SENT_BYTES:
            text = f"{sending.name} packs to {size} bytes, an edge takes {MAX_SENT_BYTES}: simplify it"
            self._end(sending, Refused(text))
            return
        revision = max(self._edge.revision(sending.name), self._last.get(sending.name, 0)) + 1
        self._last[sending.name] = revision
        sending.order = PutCharacter(sending.name, revision, digest, size, sending.fit)
        sending.ask_at = float("inf")
        self._ask(sending.order, partial(self._told, sending))
        self._send_parts(sending)  # with the announcement: an answer first would take one frame of the edge

    def _told(self, sending: _Sending, answer: Answer) -> None:
        """Takes the answer to the question how far a character is."""
        if not isinstance(answer, Awaited):
            self._end(sending, answer)
        elif sending.under_way:
            return  # their answers say how far it is
        elif answer.received >= len(sending.data):
            sending.ask_at = time.monotonic() + _ASK_AGAIN
        else:
            sending.sent, sending.refused = answer.received, False
            self._send_parts(sending)

    def _send_parts(self, sending: _Sending) -> None:
        assert sending.order is not None
        if self._sending.get(sending.name) is not sending:
            return
        while sending.under_way < _PARTS_UNDER_WAY and sending.sent < len(sending.data):
            data = sending.data[sending.sent : sending.sent + MAX_PART_BYTES]
            part = CharacterPart(sending.name, sending.order.digest, sending.sent, data)
            sending.sent += len(data)
            sending.under_way += 1
            self._ask(part, partial(self._part_told, sending))

    def _part_told(self, sending: _Sending, answer: Answer) -> None:
        """Takes the answer to a part; where it was refused, asks from where to go on."""
        sending.under_way -= 1
        sending.refused |= not isinstance(answer, Awaited)
        if not sending.refused:
            self._send_parts(sending)
        if sending.under_way:
            return
        sending.restarts += sending.refused
        sending.ask_at = time.monotonic() + (_PAUSE if sending.refused else _ASK_AGAIN)
        if sending.restarts > _MOST_RESTARTS:
            self._end(sending, answer)

    def _end(self, sending: _Sending, answer: Answer) -> None:
        """Ends a sending, and begins the one that waits for it."""
        if self._sending.pop(sending.name, None) is None:
            return
        if isinstance(answer, Done):
            self._last[sending.name] = max(self._last.get(sending.name, 0), self._edge.revision(sending.name))
        else:
            self._last.pop(sending.name, None)  # the edge refuses revisions far above its own
        sending.then(answer)
        waiting = self._next.pop(sending.name, None)
        if waiting is not None:
            waiting()

    def _ask(self, body: Ask, told: Then) -> None:
        """Sends a request; an edge that does not answer refuses."""
        silent = Refused("the edge does not answer")
        if not self._edge.request(body, _ANSWER_WITHIN, lambda answer: told(answer or silent)):
            told(Refused("there is no edge"))
