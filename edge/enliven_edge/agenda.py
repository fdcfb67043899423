"""What viewers want done, in fair order and within a time a frame."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Hashable

from enliven.wire.messages import SUPERSEDED, Lock, Look, Order, Possess, Release, Smooth
from enliven_edge.control import Command
from enliven_edge.doors import Connection

_MOST = 1024
"""Commands that wait; of more than these the ones of viewers that have gone are forgotten."""


_RESERVED = 0.4
"""Of the time, for viewers that have asked little of late: they need not wait until others are made up for."""
_LITTLE = 0.01
"""Seconds of the edge's time that such a viewer has cost of late at most: tens of small orders a second."""
_KNOWN_AFTER = 1.0
"""Seconds that such a viewer is connected, so that coming anew does not make one of a flood."""


class Agenda:
    """Commands that wait: the viewer that has cost least of late comes first, each viewer's keep their order.

    Args:
        budget: seconds a call of :meth:`work`. A command that takes longer is carried out, and the calls
            after it do nothing until that is made up for.
    """

    def __init__(self, budget: float) -> None:
        self._shares = [budget * (1 - _RESERVED), budget * _RESERVED]
        self._purses = list(self._shares)
        self._waiting: dict[Connection, deque[Command]] = {}

    def add(self, command: Command) -> None:
        """One more; an older one of its viewer that it makes needless is refused."""
        own = self._waiting.setdefault(command.peer, deque())
        subject = subject_of(command.request)
        older = next((c for c in own if subject is not None and subject_of(c.request) == subject), None)
        if older is not None:
            own.remove(older)
            older.reply_refused(SUPERSEDED)
        own.append(command)
        if sum(map(len, self._waiting.values())) > _MOST:
            self._waiting = {peer: w for peer, w in self._waiting.items() if peer.is_open}

    def work(self, do: Callable[[Command], None]) -> None:
        """Carries out what there is time for."""
        self._purses = [
            min(purse + share, share) for purse, share in zip(self._purses, self._shares, strict=True)
        ]
        while self._waiting:
            peer = min(self._waiting, key=lambda p: p.cost)
            little = peer.cost < _LITTLE and time.monotonic() - peer.opened > _KNOWN_AFTER
            usable = [i for i in range(1 + little) if self._purses[i] > 0]
            if not usable:
                return
            start = time.perf_counter()
            do(self._waiting[peer].popleft())
            took = time.perf_counter() - start
            peer.charge(took)
            self._purses[usable[0]] -= took
            if not self._waiting[peer]:
                del self._waiting[peer]


def subject_of(order: Order) -> Hashable:
    """What a newer order of the same subject makes needless; None where each order counts."""
    match order:
        case Look():
            return "look"
        case Lock():
            return "lock"
        case Smooth():
            return "smooth", order.body
        case Release():
            return "release", order.character, order.body
        case Possess() if order.mode in ("alone", "preview"):
            return order.mode, order.character
    return None
