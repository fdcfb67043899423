"""Finds free ports for programs that are started together and must know each other's ports beforehand."""

from __future__ import annotations

import contextlib
import random
import socket

from enliven.errors import ResourceError

PORTS = range(20_000, 30_000)
"""Range of the ports that are tried. It is below the range of ephemeral ports, which operating systems assign
to clients. So no client can occupy a port before the server starts, or while it restarts."""


def free_ports(count: int = 2, host: str = "127.0.0.1") -> tuple[int, ...]:
    """Returns ``count`` different TCP ports of ``host`` that no program listens on.

    Raises:
        ResourceError: if fewer ports are free.
    """
    ports: list[int] = []
    # Use a separate random generator. Otherwise two programs with the same random seed would choose the same
    # ports.
    for port in random.SystemRandom().sample(PORTS, len(PORTS)):
        if len(ports) == count:
            break
        with (
            socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as candidate,
            contextlib.suppress(OSError),
        ):
            candidate.bind((host, port))
            ports.append(port)
    if len(ports) < count:
        raise ResourceError(
            f"fewer than {count} ports from {PORTS[0]} to {PORTS[-1]} are free on {host}",
            remedy="End programs that use these ports, or choose the ports.",
        )
    return tuple(ports)
