"""Characters that clients put on the stage while it runs: collected, prepared beside the frames, shown."""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections import deque
from dataclasses import dataclass, field

from enliven.errors import EnlivenError, InputError, plain_reason
from enliven.files import DAMAGE
from enliven.possession import Actor
from enliven.wire import (
    MAX_SENT_BYTES,
    Answer,
    Awaited,
    CharacterPart,
    Done,
    PutCharacter,
)
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage import Carried, Stage

log = logging.getLogger(__name__)

_MOST_WAITING = 4
"""Characters that are collected at a time; together they have at most ``MAX_SENT_BYTES``."""
_GIVEN_UP = 10.0
"""Seconds without a part after which a character is not waited for any longer."""
_MOST_REFUSED = 32
"""Refusals that are remembered, so that equal data is not prepared again."""

_Key = tuple[str, bytes]
"""The id and the digest of a character."""


@dataclass
class _Arrival:
    """A character that is being collected."""

    order: PutCharacter
    parts: list[bytes] = field(default_factory=list)
    received: int = 0
    heard: float = field(default_factory=time.monotonic)


class _Preparation(threading.Thread):
    """Makes the actor of a character; the solvers' kernels let the frames go on meanwhile."""

    def __init__(self, arrival: _Arrival, stage: Stage, settings: EdgeSettings) -> None:
        super().__init__(name="preparation", daemon=True)
        self.order, self._data = arrival.order, b"".join(arrival.parts)
        self._stage, self._settings = stage, settings
        self.actor: Actor | None = None
        self.refused: InputError | None = None
        self.carried: Carried | None = None

    def run(self) -> None:
        from enliven_edge.sent_characters import cast_sent  # what an edge without clients never needs

        where, mend = f"character {self.order.id!r}", "Send it again."
        try:
            if hashlib.sha256(self._data).digest() != self.order.digest:
                raise InputError("it was changed on its way", where=where, mend=mend)
            former = self._stage.actors.get(self.order.id)
            actor = cast_sent(self._data, self.order, self._settings, former)
            self.carried = self._stage.carry_over(actor)
            self.actor = actor
        except EnlivenError as error:
            self.refused = InputError(error.what, where=error.where or where, mend=error.mend)
        except (*DAMAGE, RuntimeError) as error:
            what = f"it is damaged: {plain_reason(error)}"
            self.refused = InputError(what, where=where, mend="Look at it in enliven studio.")


class Arrivals:
    """Collects, prepares and puts the characters that clients send; what stood there stays until then.

    Args:
        settings: how characters are cast.
    """

    def __init__(self, stage: Stage, settings: EdgeSettings | None = None) -> None:
        self._stage, self._settings = stage, settings or EdgeSettings()
        self._waiting: dict[_Key, _Arrival] = {}
        self._complete: deque[_Arrival] = deque()
        self._under_way: _Preparation | None = None
        self._standing: dict[str, PutCharacter] = {}
        self._refused: dict[PutCharacter, InputError] = {}

    @property
    def revisions(self) -> dict[str, int]:
        """The revisions of the characters that clients put on the stage, by id."""
        return {name: order.revision for name, order in self._standing.items()}

    def put(self, order: PutCharacter) -> Answer:
        """Announces a character, or asks how far it is.

        Raises:
            InputError: where it was refused, is no later revision, or too many are on their way.
        """
        now = self._standing.get(order.id)
        if now is not None and (now.digest, now.fit) == (order.digest, order.fit):
            return Done()
        if order in self._refused:
            raise self._refused[order]
        where = f"character {order.id!r}"
        if now is not None and order.revision <= now.revision:
            mend = f"Send revision {now.revision + 1}, or a later one."
            raise InputError(f"revision {now.revision} of it stands on the stage", where=where, mend=mend)
        if any(order == each.order for each in self._complete) or (
            self._under_way is not None and self._under_way.order == order
        ):
            return Awaited(order.size)
        return Awaited(self._expect(order, where).received)

    def take(self, part: CharacterPart) -> Answer:
        """Takes the next part of a character that was announced.

        Raises:
            InputError: for a part that nothing waits for.
        """
        key = part.id, part.digest
        arrival = self._waiting.get(key)
        if arrival is None or part.offset != arrival.received:
            mend = "Ask how far it is with PutCharacter."
            raise InputError("this part is not waited for", where=f"character {part.id!r}", mend=mend)
        arrival.received += len(part.data)
        arrival.heard = time.monotonic()
        if arrival.received > arrival.order.size:
            del self._waiting[key]
            what = f"more than the {arrival.order.size} bytes that were announced came"
            raise InputError(what, where=f"character {part.id!r}", mend="Announce it again.")
        arrival.parts.append(part.data)
        if arrival.received == arrival.order.size:
            self._complete.append(self._waiting.pop(key))
        return Awaited(arrival.received)

    def poll(self) -> None:
        """Puts on the stage what is ready, and begins to prepare what has come; call it once a frame."""
        self._standing = {name: it for name, it in self._standing.items() if name in self._stage.actors}
        ready = self._under_way
        if ready is not None and not ready.is_alive():
            self._under_way = None
            self._finish(ready)
        if self._under_way is None and self._complete:
            self._under_way = _Preparation(self._complete.popleft(), self._stage, self._settings)
            self._under_way.start()

    def _finish(self, ready: _Preparation) -> None:
        """Puts a character that was prepared on the stage, or remembers why it was refused."""
        order, now = ready.order, self._standing.get(ready.order.id)
        if ready.actor is None:
            what = f"the preparation of {order.id!r} ended early"
            self._refused[order] = ready.refused or InputError(what, where="stage", mend="Look at the log.")
            log.warning("%s", self._refused[order])
            for old in list(self._refused)[:-_MOST_REFUSED]:
                del self._refused[old]
        elif now is None or now.revision < order.revision:
            self._stage.put(ready.actor, ready.carried)
            self._standing[order.id] = order
            log.info("%s stands on the stage, revision %d", order.id, order.revision)

    def _expect(self, order: PutCharacter, where: str) -> _Arrival:
        """Returns the collection of a character; it replaces one of an earlier revision."""
        key, now = (order.id, order.digest), time.monotonic()
        known = self._waiting.get(key)
        if known is not None and known.order == order:
            return known
        self._waiting = {
            key: each
            for key, each in self._waiting.items()
            if each.order.id != order.id and now - each.heard < _GIVEN_UP
        }
        room = MAX_SENT_BYTES - sum(each.order.size for each in self._waiting.values())
        if len(self._waiting) >= _MOST_WAITING or order.size > room:
            mend = "Send it again in a moment."
            raise InputError("too many characters are on their way", where=where, mend=mend)
        self._waiting[key] = _Arrival(order)
        return self._waiting[key]
