"""Finds free ports for programs that are started together and must know each other's ports beforehand."""

from __future__ import annotations

import socket


def free_ports(count: int = 2, host: str = "127.0.0.1") -> tuple[int, ...]:
    """Returns ``count`` different TCP ports of ``host`` without a listening program."""
    sockets = [socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) for _ in range(count)]
    try:
        for s in sockets:
            s.bind((host, 0))
        return tuple(s.getsockname()[1] for s in sockets)
    finally:
        for s in sockets:
            s.close()
