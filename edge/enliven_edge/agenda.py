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


class Agenda:
    """Commands that wait: the viewer that has cost least of late comes first, each viewer's keep their order.

    Args:
        budget: seconds a call of :meth:`work`. A command that takes longer is carried out, and the calls
            after it do nothing until that is made up for.
    """

    def __init__(self, budget: float) -> None:
        self._budget = self._purse = budget
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
        self._purse = min(self._purse + self._budget, self._budget)
        while self._waiting and self._purse > 0:
            peer = min(self._waiting, key=lambda p: p.cost)
            start = time.perf_counter()
            do(self._waiting[peer].popleft())
            took = time.perf_counter() - start
            peer.charge(took)
            self._purse -= took
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
