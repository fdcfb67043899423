"""Carries out the commands of viewers in fair order, within a time budget per frame (a rate limit)."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from enliven.wire import SUPERSEDED, Refused
from enliven_edge.network.connection import Connection
from enliven_edge.network.control_socket import Command

_MAX_QUEUED_COMMANDS = 1024
"""Maximum number of queued commands. If there are more, the commands of disconnected viewers are dropped."""
_RESERVED_FRACTION = 0.4
"""Fraction of the time budget that is reserved for viewers with few requests. It prevents delays by other
viewers that flood the edge."""
_LOW_COST_S = 0.06
"""Seconds of recent cost below which a viewer may use the reserve. Ten small orders per second cost half of
this value."""
_MIN_CONNECTED_S = 1.0
"""Seconds of connection before a viewer may use the reserve. Without this delay, a flood could reconnect to
use it."""
_MAX_RESERVED_ORDERS = 4
"""Maximum number of waiting orders of a viewer that uses the reserve. People send one order at a time, a
flood sends many."""
MAX_DEBT_FRAMES = 15
"""Maximum debt after a slow order, in frames: half a second. With a larger debt the edge would seem to ignore
the next order."""
_FRAME_S = 1 / 30
"""Duration in seconds of a frame of usual length. A longer frame increases the budget, so that a slow edge
still answers."""
_MAX_SAVED_FRAMES = 50
"""Maximum unused time that is saved, in frames. Because of it, a few orders in one frame need not wait."""


class CommandQueue:
    """Sorts the queued commands of all viewers, and keeps the order of each viewer's commands.

    The viewer with the lowest cost of recent commands comes first. The commands of disconnected viewers come
    last.

    Args:
        budget: seconds for commands in each frame of usual length. Unused time is saved for later calls of
            :meth:`execute_commands`. A command that exceeds the budget is still carried out. The following
            calls then do nothing until they have saved the missing time.
    """

    def __init__(self, budget: float) -> None:
        self._shares = [budget * (1 - _RESERVED_FRACTION), budget * _RESERVED_FRACTION]
        self._budgets = [_MAX_SAVED_FRAMES * share for share in self._shares]
        self._waiting: dict[Connection, deque[Command]] = {}
        self._last_work_at = time.monotonic()

    def add(self, command: Command) -> None:
        """Adds a command. An older command of the same viewer with the same subject is refused."""
        queued = self._waiting.setdefault(command.peer, deque())
        same_subject = (c for c in queued if c.subject is not None and c.subject == command.subject)
        older_command = next(same_subject, None)
        if older_command is not None:
            queued.remove(older_command)
            older_command.reply(Refused(SUPERSEDED))
        queued.append(command)
        if sum(map(len, self._waiting.values())) > _MAX_QUEUED_COMMANDS:
            self._waiting = {peer: w for peer, w in self._waiting.items() if peer.is_open}

    def execute_commands(self, execute: Callable[[Command], None]) -> None:
        """Carries out commands as far as the time budget allows."""
        now = time.monotonic()
        frames, self._last_work_at = (
            min(max((now - self._last_work_at) / _FRAME_S, 1.0), _MAX_SAVED_FRAMES),
            now,
        )
        self._budgets = [
            min(budget + frames * share, _MAX_SAVED_FRAMES * share)
            for budget, share in zip(self._budgets, self._shares, strict=True)
        ]
        while (next_turn := self._choose_next()) is not None:
            peer, budget = next_turn
            start = time.perf_counter()
            execute(self._waiting[peer].popleft())
            duration = time.perf_counter() - start
            peer.add_cost(duration)
            self._budgets[budget] = max(
                self._budgets[budget] - duration, -MAX_DEBT_FRAMES * self._shares[budget]
            )
            if not self._waiting[peer]:
                del self._waiting[peer]

    def _choose_next(self) -> tuple[Connection, int] | None:
        """Returns the viewer of the next command, and the index of the budget to charge.

        Returns None if no command is left.

        Viewers with a low load are charged to the reserve.
        """
        if self._budgets[0] > 0:
            budget, peers = 0, list(self._waiting)
        elif self._budgets[1] > 0:
            budget, peers = 1, [peer for peer in self._waiting if self._has_low_load(peer)]
        else:
            return None
        peer = min(peers, key=lambda p: (not p.is_open, p.cost), default=None)
        return None if peer is None else (peer, budget)

    def _has_low_load(self, peer: Connection) -> bool:
        """Returns True if a viewer may use the reserve."""
        is_known = peer.is_open and time.monotonic() - peer.opened > _MIN_CONNECTED_S
        return is_known and peer.cost < _LOW_COST_S and len(self._waiting[peer]) <= _MAX_RESERVED_ORDERS
