"""Puts characters onto the stage of an edge.

Characters are encoded in the background and sent in chunks. Identical content is sent only once.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol

from enliven.errors import EnlivenError
from enliven.wire import (
    MAX_PART_BYTES,
    MAX_TEXTURE_BYTES,
    MAX_UPLOAD_BYTES,
    Answer,
    Ask,
    Awaited,
    CharacterPart,
    Done,
    PutCharacter,
    Refused,
    RemoveCharacter,
)

if TYPE_CHECKING:
    from enliven.document import Project

_MAX_PENDING_PARTS = 8
"""Maximum number of unanswered chunks. It allows 15 MB per second if an edge answers 30 times per second."""
_STATE_REQUEST_INTERVAL_S = 0.03
"""Seconds between two requests for the state of an upload: about a frame."""
_ANSWER_TIMEOUT_S = 5.0
"""Timeout in seconds of a request. An edge answers within a frame, or within a few frames if it is busy."""
_MAX_RESTARTS = 20
"""Maximum number of refused chunks in one upload before it is given up. Refusals may come from the edge's
rate limit.
"""
_REFUSAL_PAUSE_S = 0.25
"""Seconds to wait after a refused chunk, because the edge limits the requests per second."""

AnswerCallback = Callable[[Answer], None]


def _pack_character(project: Project, character: str) -> bytes:
    """Returns the encoded bytes of a character.

    Textures are included if they are small enough for the edge to send them back.
    """
    # Imported here, because most viewers and kiosks never send a character.
    from enliven.formats.project.one_character import character_bytes

    data = character_bytes(project, character, MAX_TEXTURE_BYTES)
    return data if len(data) <= MAX_UPLOAD_BYTES else character_bytes(project, character)


class StagedEdge(Protocol):
    """The methods of an edge's connection that a :class:`StageLink` needs."""

    def request(self, body: Ask, seconds: float, on_reply: Callable[[Answer | None], None]) -> bool:
        """Sends a request.

        Calls back with the answer, or with None after the timeout. Returns False without an edge.
        """

    def revision(self, character: str) -> int:
        """Returns the revision of a character on the edge, or 0 for none."""


@dataclass
class _Upload:
    """A character upload in progress.

    Attributes:
        packed: the character's encoded data, or None until it is ready.
        sent: number of bytes sent.
        under_way: number of unanswered chunks.
        ask_at: monotonic time of the next state request; infinite while chunks are unanswered.
        refused: True if one of the unanswered chunks was refused. Then no chunk is sent before the next state
            request.
    """

    name: str
    fit: bool
    then: AnswerCallback
    packed: Future[bytes]
    order: PutCharacter | None = None
    data: bytes = b""
    sent: int = 0
    under_way: int = 0
    ask_at: float = 0.0
    refused: bool = False
    restarts: int = 0


class StageLink:
    """Uploads characters to the stage of one edge. Call :meth:`poll` as often as the connection's ``poll``.

    If an earlier revision of a character is still being uploaded, a new revision is queued. Only the newest
    queued revision is sent.
    """

    def __init__(self, edge: StagedEdge) -> None:
        self._edge = edge
        self._packer: ThreadPoolExecutor | None = None
        self._sending: dict[str, _Upload] = {}
        self._next: dict[str, Callable[[], None]] = {}
        self._last: dict[str, int] = {}

    @property
    def is_uploading(self) -> bool:
        """Returns True if an upload is in progress."""
        return bool(self._sending)

    def put(
        self,
        project: Project,
        character: str,
        *,
        name: str = "",
        fit: bool = False,
        then: AnswerCallback | None = None,
    ) -> None:
        """Puts a character of a project onto the stage, replacing the one with its id.

        Args:
            name: the character's id on the stage; empty for the id in the project.
            fit: True to scale the mesh to a person's size before its first possession, like a mesh from a
                file.
            then: called from a later :meth:`poll` with Done once the character is on the stage, otherwise
                with Refused.
        """
        name, then = name or character, then or (lambda answer: None)
        if name in self._sending:
            self._next[name] = partial(self.put, project, character, name=name, fit=fit, then=then)
            return
        if self._packer is None:
            self._packer = ThreadPoolExecutor(1, "packer")
        packing = self._packer.submit(_pack_character, project, character)
        self._sending[name] = _Upload(name, fit, then, packing)

    def remove(self, character: str, then: AnswerCallback | None = None) -> None:
        """Removes a character from the stage."""
        on_answer = then or (lambda answer: None)
        self._send_request(RemoveCharacter(character), on_answer)

    def poll(self) -> None:
        """Continues the uploads. Does not block."""
        now = time.monotonic()
        for sending in list(self._sending.values()):
            if sending.order is None and sending.packed.done():
                self._announce(sending)
            if sending.order is not None and now >= sending.ask_at:
                sending.ask_at = float("inf")
                self._send_request(sending.order, partial(self._handle_state, sending))

    def restart(self) -> None:
        """Discards the known revisions, because a restarted edge starts to count again."""
        self._last.clear()

    def close(self) -> None:
        """Stops the encoding thread."""
        if self._packer is not None:
            self._packer.shutdown(wait=False, cancel_futures=True)

    def _announce(self, sending: _Upload) -> None:
        """Announces an encoded character to the edge."""
        try:
            sending.data = sending.packed.result()
        except EnlivenError as error:
            self._end_upload(sending, Refused(str(error)[:400]))
            return
        size, digest = len(sending.data), hashlib.sha256(sending.data).digest()
        if size > MAX_UPLOAD_BYTES:
            text = (
                f"{sending.name} has {size} bytes, but an edge accepts at most {MAX_UPLOAD_BYTES}: "
                "simplify its mesh"
            )
            self._end_upload(sending, Refused(text))
            return
        revision = max(self._edge.revision(sending.name), self._last.get(sending.name, 0)) + 1
        self._last[sending.name] = revision
        sending.order = PutCharacter(sending.name, revision, digest, size, sending.fit)
        sending.ask_at = float("inf")
        self._send_request(sending.order, partial(self._handle_state, sending))
        # Send the chunks together with the announcement. Waiting for its answer would cost one frame of the
        # edge.
        self._send_parts(sending)

    def _handle_state(self, sending: _Upload, answer: Answer) -> None:
        """Processes the answer to a state request."""
        if not isinstance(answer, Awaited):
            self._end_upload(sending, answer)
        elif sending.under_way:
            return  # Ignore this answer, because the answers to the chunks will report the state.
        elif answer.received >= len(sending.data):
            sending.ask_at = time.monotonic() + _STATE_REQUEST_INTERVAL_S
        else:
            sending.sent, sending.refused = answer.received, False
            self._send_parts(sending)

    def _send_parts(self, sending: _Upload) -> None:
        assert sending.order is not None
        if self._sending.get(sending.name) is not sending:
            return
        while sending.under_way < _MAX_PENDING_PARTS and sending.sent < len(sending.data):
            data = sending.data[sending.sent : sending.sent + MAX_PART_BYTES]
            part = CharacterPart(sending.name, sending.order.digest, sending.sent, data)
            sending.sent += len(data)
            sending.under_way += 1
            self._send_request(part, partial(self._handle_part_answer, sending))

    def _handle_part_answer(self, sending: _Upload, answer: Answer) -> None:
        """Processes the answer to a chunk. After a refusal, requests the state to find out
        where to continue.
        """
        sending.under_way -= 1
        sending.refused |= not isinstance(answer, Awaited)
        if not sending.refused:
            self._send_parts(sending)
        if sending.under_way:
            return
        sending.restarts += sending.refused
        sending.ask_at = time.monotonic() + (
            _REFUSAL_PAUSE_S if sending.refused else _STATE_REQUEST_INTERVAL_S
        )
        if sending.restarts > _MAX_RESTARTS:
            self._end_upload(sending, answer)

    def _end_upload(self, sending: _Upload, answer: Answer) -> None:
        """Ends an upload, and starts the queued one."""
        if self._sending.pop(sending.name, None) is None:
            return
        if isinstance(answer, Done):
            self._last[sending.name] = max(self._last.get(sending.name, 0), self._edge.revision(sending.name))
        else:
            # Forget the revision, because the edge refuses a revision that is much higher than its own.
            self._last.pop(sending.name, None)
        sending.then(answer)
        waiting = self._next.pop(sending.name, None)
        if waiting is not None:
            waiting()

    def _send_request(self, body: Ask, on_answer: AnswerCallback) -> None:
        """Sends a request. A missing answer counts as a refusal."""
        silent = Refused("the edge does not answer")
        if not self._edge.request(body, _ANSWER_TIMEOUT_S, lambda answer: on_answer(answer or silent)):
            on_answer(Refused("no edge is connected"))
