"""Orders of viewers are carried out within a budget of time, and a slow one does not silence its viewer."""

from __future__ import annotations

import socket
import time

from enliven.wire import Release, ZmtpSession
from enliven_edge.network.command_queue import _OWED, CommandQueue
from enliven_edge.network.connection import Connection
from enliven_edge.network.control_socket import Command

BUDGET = 5e-4
"""Seconds a call: an edge's default at 30 frames a second."""


def test_after_a_slow_order_the_next_is_carried_out_within_half_a_second() -> None:
    near, far = socket.socketpair()
    peer, queue, done = (
        Connection(near, "here", ZmtpSession("ROUTER", 1000)),
        CommandQueue(BUDGET),
        list[str](),
    )

    def order(name: str) -> Command:
        return Command(Release(name), "window", peer, lambda answer: None)

    def do(command: Command) -> None:
        until = time.perf_counter() + (0.1 if command.request.character == "slow" else 0.0)  # type: ignore[union-attr]
        while time.perf_counter() < until:
            pass
        done.append(command.request.character)  # type: ignore[union-attr]

    with near, far:
        queue.add(order("slow"))
        queue.work(do)
        queue.add(order("next"))
        calls = 0
        while "next" not in done:
            calls += 1
            queue.work(do)
            assert calls <= _OWED + 1
        assert calls > 1, "the slow one is made up for a little"
