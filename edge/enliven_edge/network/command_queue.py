"""Carries out the commands of viewers in fair order within a time budget for each frame."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from enliven.wire import SUPERSEDED, Refused
from enliven_edge.network.connection import Connection
from enliven_edge.network.control_socket import Command

_MOST = 1024
"""Commands that wait; beyond these the commands of disconnected viewers are dropped."""
_RESERVED = 0.4
"""Share of the time budget for viewers with few requests: a flood of others does not delay them."""
_LITTLE = 0.06
"""Seconds of recent cost up to which a viewer may use the reserve: half is ten small orders a second."""
_KNOWN_AFTER = 1.0
"""Seconds of connection before a viewer may use the reserve, so that reconnecting does not help a flood."""
_FEW = 4
"""Waiting orders up to which a viewer may use the reserve: a person gives one at a time, a flood many."""
_OWED = 15
"""Frames of time at most that are owed after a slow order: half a second, or the next one seems unheard."""
_STEP = 1 / 30
"""Seconds of a frame that the budget is meant for: a longer one brings more, so that a slow edge answers."""
_SAVED = 50
"""Frames of unused time that are saved up, so that a few orders in one frame need not wait."""


class CommandQueue:
    """Orders the waiting commands: the viewer of least recent cost first, each viewer's in their order.

    Those of viewers that have gone come last.

    Args:
        budget: seconds for each frame of usual length between two calls of :meth:`work`, beside some that
            earlier calls did not need. A command that takes longer is carried out, and the calls after it do
            nothing until that is made up for, or some have passed.
    """

    def __init__(self, budget: float) -> None:
        self._shares = [budget * (1 - _RESERVED), budget * _RESERVED]
        self._budgets = [_SAVED * share for share in self._shares]
        self._waiting: dict[Connection, deque[Command]] = {}
        self._worked = time.monotonic()

    def add(self, command: Command) -> None:
        """Adds a command; an older command of its viewer on the same subject is refused."""
        own = self._waiting.setdefault(command.peer, deque())
        same = (c for c in own if c.subject is not None and c.subject == command.subject)
        older = next(same, None)
        if older is not None:
            own.remove(older)
            older.reply(Refused(SUPERSEDED))
        own.append(command)
        if sum(map(len, self._waiting.values())) > _MOST:
            self._waiting = {peer: w for peer, w in self._waiting.items() if peer.is_open}

    def work(self, do: Callable[[Command], None]) -> None:
        """Carries out commands as far as the time budget allows."""
        now = time.monotonic()
        frames, self._worked = min(max((now - self._worked) / _STEP, 1.0), _SAVED), now
        self._budgets = [
            min(budget + frames * share, _SAVED * share)
            for budget, share in zip(self._budgets, self._shares, strict=True)
        ]
        while (found := self._next()) is not None:
            peer, budget = found
            start = time.perf_counter()
            do(self._waiting[peer].popleft())
            took = time.perf_counter() - start
            peer.charge(took)
            self._budgets[budget] = max(self._budgets[budget] - took, -_OWED * self._shares[budget])
            if not self._waiting[peer]:
                del self._waiting[peer]

    def _next(self) -> tuple[Connection, int] | None:
        """Returns the viewer of the next command and the budget to charge; None: none is left."""
        if self._budgets[0] > 0:
            budget, peers = 0, list(self._waiting)
        elif self._budgets[1] > 0:
            budget, peers = 1, [peer for peer in self._waiting if self._asks_little(peer)]
        else:
            return None
        peer = min(peers, key=lambda p: (not p.is_open, p.cost), default=None)
        return None if peer is None else (peer, budget)

    def _asks_little(self, peer: Connection) -> bool:
        """Returns whether a viewer may use the reserve."""
        known = peer.is_open and time.monotonic() - peer.opened > _KNOWN_AFTER
        return known and peer.cost < _LITTLE and len(self._waiting[peer]) <= _FEW
