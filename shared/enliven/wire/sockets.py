"""The address of an edge, and a viewer's sockets with their options (small queues, no lingering,
non-blocking)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import zmq

from enliven.errors import InputError
from enliven.keys.client import ClientKeys, find_client_keys

POSE_PORT = 5580
"""Default TCP port of the streams. It is above 1023, so no privileges are needed."""
CONTROL_PORT = 5581
"""Default TCP port of the requests, the next port after :data:`POSE_PORT`."""
SEND_QUEUE_LENGTH = 1000
"""Maximum number of messages in the queue to an edge."""
MAX_UNREAD_STREAMS = 500
"""Maximum number of unread stream messages of an edge, at most 128 MB. Further messages wait in the operating
system's buffers.
"""
MAX_UNREAD_REPLIES = 4
"""Maximum number of unread replies of an edge. A reply with a character may have 128 MB."""


@dataclass(frozen=True)
class Endpoint:
    """An edge's address: its host, the port of its streams and the port of its requests."""

    host: str = "127.0.0.1"
    pose_port: int = POSE_PORT
    control_port: int = CONTROL_PORT

    def __str__(self) -> str:
        return f"{_bracket_host(self.host)}:{self.pose_port}:{self.control_port}"

    @property
    def stream_address(self) -> str:
        """The address for a viewer's SUB socket."""
        return f"tcp://{_bracket_host(self.host)}:{self.pose_port}"

    @property
    def control_address(self) -> str:
        """The address for a viewer's DEALER socket."""
        return f"tcp://{_bracket_host(self.host)}:{self.control_port}"

    def find_keys(self) -> ClientKeys | None:
        """Returns the keys for the edge at this address, or None if this user is not paired with it.

        Raises:
            InputError: if a key file is missing, damaged, or readable by other users.
        """
        return find_client_keys(self.host, self.control_port)


def parse_endpoint(text: str) -> Endpoint:
    """Parses ``host``, ``host:port`` or ``host:port:control_port``, with IPv6 in brackets.

    The default of the control port is ``port`` + 1.

    Raises:
        InputError: if the text does not have one of these forms.
    """
    host, ports = text.strip().removeprefix("tcp://"), ""
    if host.startswith("["):
        host, _, ports = host[1:].partition("]")
        ports = ports.removeprefix(":")
    else:
        host, _, ports = host.partition(":")
    numbers = [int(p) for p in ports.split(":") if p.isdecimal()]
    if len(numbers) == 1:
        numbers.append(numbers[0] + 1)
    pose, control = numbers if len(numbers) == 2 else (POSE_PORT, CONTROL_PORT)
    has_valid_ports = not ports or (len(numbers) == 2 and all(p.isdecimal() for p in ports.split(":")))
    valid = has_valid_ports and 0 < pose < 65536 and 0 < control < 65536
    if not host or not valid or any(c.isspace() or c in "/;" for c in host):
        raise InputError(
            f"{text!r} is not an address of an edge",
            remedy="Write HOST, HOST:PORT or HOST:PORT:CONTROL_PORT.",
        )
    return Endpoint(host, pose, control)


def make_socket(
    context: zmq.Context[Any], kind: int, max_bytes: int, unread: int, keys: ClientKeys | None = None
) -> zmq.Socket[bytes]:
    """Returns a viewer's socket: non-blocking, without lingering.

    The socket disconnects an edge that sends messages that are too large.

    TCP keep-alive detects an edge that disappeared without closing the connection, so that the socket
    reconnects. libzmq's own heartbeat is not used, because it aborts the program if a connection breaks while
    its queue is full.

    Args:
        kind: kind of the socket, such as ``zmq.SUB``.
        max_bytes: maximum size of a message.
        unread: maximum number of unread messages.
        keys: the keys for the edge that the socket will connect to. None for a connection without encryption.
    """
    socket: zmq.Socket[bytes] = context.socket(kind)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.SNDHWM, SEND_QUEUE_LENGTH)
    socket.setsockopt(zmq.RCVHWM, unread)
    socket.setsockopt(zmq.MAXMSGSIZE, max_bytes)
    socket.setsockopt(zmq.IPV6, 1)
    socket.setsockopt(zmq.RECONNECT_IVL, 50)
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, 500)
    socket.setsockopt(zmq.HANDSHAKE_IVL, 3000)
    socket.setsockopt(zmq.TCP_KEEPALIVE, 1)
    socket.setsockopt(zmq.TCP_KEEPALIVE_IDLE, 2)
    socket.setsockopt(zmq.TCP_KEEPALIVE_INTVL, 2)
    socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, 2)
    socket.setsockopt(zmq.TCP_MAXRT, 6000)
    if keys is not None:
        keys.encrypt_socket(socket)
    return socket


def _bracket_host(host: str) -> str:
    return f"[{host}]" if ":" in host else host
