"""Receives a single heartbeat of an edge, for health checks by scripts or from another machine."""

from __future__ import annotations

import time
from typing import Any

import zmq

from enliven.errors import ResourceError
from enliven.keys.client import HandshakeMonitor, handshake_advice
from enliven.wire.envelope import MalformedMessageError, OtherVersionError, unpack_stream
from enliven.wire.sockets import MAX_UNREAD_STREAMS, Endpoint, make_socket
from enliven.wire.streams import StatusMessage
from enliven.wire.topics import MAX_STREAM_BYTES, STATUS

_POLL_INTERVAL_MS = 100
"""Interval in milliseconds at which the state of the connection is checked while waiting for a message."""


def receive_heartbeat(endpoint: Endpoint, seconds: float) -> StatusMessage:
    """Returns the next heartbeat of an edge.

    Args:
        seconds: maximum time to wait. An edge sends two per second.

    Raises:
        ResourceError: if no heartbeat arrives in time, or the edge has another protocol version or another
            key.
        InputError: if a key file is damaged or readable by other users.
    """
    context: zmq.Context[Any] = zmq.Context.instance()
    keys = endpoint.find_keys()
    socket, other_version = make_socket(context, zmq.SUB, MAX_STREAM_BYTES, MAX_UNREAD_STREAMS, keys), ""
    watch = HandshakeMonitor(socket, keys is not None)
    try:
        socket.setsockopt(zmq.SUBSCRIBE, b"")
        socket.connect(endpoint.stream_address)
        end = time.monotonic() + seconds
        while (remaining := end - time.monotonic()) > 0:
            watch.poll()
            if watch.problem:
                break
            if not socket.poll(min(max(round(1000 * remaining), 1), _POLL_INTERVAL_MS)):
                continue
            try:
                topic, message = unpack_stream(b"".join(socket.recv_multipart(zmq.DONTWAIT)))
            except OtherVersionError as error:
                other_version = str(error)
            except (MalformedMessageError, zmq.Again):
                continue
            else:
                if topic is STATUS and isinstance(message, StatusMessage):
                    return message
    finally:
        watch.close()
        socket.close(linger=0)
    where = str(endpoint)
    if watch.problem:
        problem, _, remedy = handshake_advice(watch.problem, endpoint.host).partition(". ")
        raise ResourceError(f"the edge {problem}", where=where, remedy=f"{remedy}.")
    if other_version:
        raise ResourceError(
            other_version, where=where, remedy="Install the same version of enliven on both computers."
        )
    remedy = (
        "Start the edge: enliven edge, with --host for viewers on other computers. Check the address "
        "and the firewall."
    )
    raise ResourceError(f"no edge sent a heartbeat for {seconds:g} s", where=where, remedy=remedy)
