"""The commands of viewers, carried out in fair order within a time budget for each frame."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Hashable

from enliven.wire import SUPERSEDED, Lock, Look, Order, Possess, Release, Smooth
from enliven_edge.network.connection import Connection
from enliven_edge.network.control_socket import Command

_MOST = 1024
"""Commands that wait; of more than these the ones of viewers that have gone are forgotten."""


_RESERVED = 0.4
"""Of the time, for viewers that have asked little: they do not wait until others are made up for."""
_LITTLE = 0.06
"""Seconds that such a viewer has cost of late at most: ten small orders a second are half of it."""
_KNOWN_AFTER = 1.0
"""Seconds that such a viewer has been connected, so that coming anew is of no use to a flood."""
_FEW = 4
"""Orders of such a viewer that wait at most: a person gives one at a time, a flood piles them up."""
_SAVED = 50
"""Frames whose time is saved up while nothing is asked, so that a few orders in one frame need not wait."""


class CommandQueue:
    """Commands that wait: the viewer that cost least of late is first, each viewer's keep their order.

    Those of viewers that have gone come last.

    Args:
        budget: seconds a call of :meth:`work`, beside some that earlier calls did not need. A command that
            takes longer is carried out, and the calls after it do nothing until that is made up for.
    """

    def __init__(self, budget: float) -> None:
        self._shares = [budget * (1 - _RESERVED), budget * _RESERVED]
        self._budgets = [_SAVED * share for share in self._shares]
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
        self._budgets = [
            min(budget + share, _SAVED * share)
            for budget, share in zip(self._budgets, self._shares, strict=True)
        ]
        while (found := self._next()) is not None:
            peer, budget = found
            start = time.perf_counter()
            do(self._waiting[peer].popleft())
            took = time.perf_counter() - start
            peer.charge(took)
            self._budgets[budget] -= took
            if not self._waiting[peer]:
                del self._waiting[peer]

    def _next(self) -> tuple[Connection, int] | None:
        """Whose command is next and which budget pays for it; None: nothing waits that can be paid for."""
        if self._budgets[0] > 0:
            budget, peers = 0, list(self._waiting)
        elif self._budgets[1] > 0:
            budget, peers = 1, [peer for peer in self._waiting if self._asks_little(peer)]
        else:
            return None
        peer = min(peers, key=lambda p: (not p.is_open, p.cost), default=None)
        return None if peer is None else (peer, budget)

    def _asks_little(self, peer: Connection) -> bool:
        """Whether a viewer may be paid for out of what is reserved."""
        known = peer.is_open and time.monotonic() - peer.opened > _KNOWN_AFTER
        return known and peer.cost < _LITTLE and len(self._waiting[peer]) <= _FEW


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
