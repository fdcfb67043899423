"""A UDP socket that listens for the packets of another program."""

from __future__ import annotations

import socket

from enliven.errors import InputError, ResourceError

MAX_PACKET_BYTES = 65_536
"""Maximum bytes of a UDP packet."""
_BUFFER_BYTES = 1 << 20
"""Size in bytes of the system's receive buffer. Some frames are queued there while the edge is busy."""


def listen_udp(host: str, port: int, where: str) -> socket.socket:
    """Returns a bound UDP socket.

    Args:
        host: the address to listen on. "0.0.0.0" also accepts other machines.
        port: the UDP port. 0 picks a free one.
        where: the name of the sensor, for error messages.

    Raises:
        InputError: for a number that is not a port.
        ResourceError: for a port in use, or an address that does not belong to this machine.
    """
    if not 0 <= port <= 65535:
        raise InputError(
            f"{port} is not a UDP port", where=where, remedy="Set port to a number from 1 to 65535."
        )
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
    try:
        receiver.bind((host, port))
    except OSError as error:
        receiver.close()
        remedy = (
            "Close the other program that uses this port, or set another port here and in the sending "
            "program."
        )
        problem = f"port {port} of {host} cannot be opened ({error.strerror})"
        raise ResourceError(problem, where=where, remedy=remedy) from None
    return receiver
