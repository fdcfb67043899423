"""Finds free ports for programs that are started together and must know each other's ports beforehand."""

from __future__ import annotations

import contextlib
import random
import socket

from enliven.errors import ResourceError

PORTS = range(20_000, 30_000)
"""Ports that are tried. They are below those that systems give to clients, so that no client gets
a port before its program has started, or while it restarts."""


def free_ports(count: int = 2, host: str = "127.0.0.1") -> tuple[int, ...]:
    """Returns ``count`` different TCP ports of ``host`` without a listening program.

    Raises:
        ResourceError: if fewer are free.
    """
    ports: list[int] = []
    # A program that seeds Python's random numbers must not choose the same ports as its copy.
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
            remedy="End programs that listen there, or name the ports.",
        )
    return tuple(ports)
