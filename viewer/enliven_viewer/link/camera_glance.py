"""Receives the newest camera image of an edge without a full connection, for a list of edges."""

from __future__ import annotations

from typing import Any

import zmq

from enliven.errors import EnlivenError
from enliven.wire import (
    CAMERA,
    CameraMessage,
    Endpoint,
    MalformedMessageError,
    make_socket,
    unpack_stream,
)

_MAX_UNREAD = 4
"""Maximum number of unread images. An edge sends five per second."""
_MAX_BYTES = 32 * 1024
"""Maximum bytes of a message."""


class CameraGlance:
    """A ZeroMQ SUB socket that receives only the camera images of an edge. It never blocks.

    Attributes:
        camera: the newest image; None before the first image, or if the edge does not send any.
    """

    def __init__(self, endpoint: Endpoint) -> None:
        self.endpoint = endpoint
        self.camera: CameraMessage | None = None
        context: zmq.Context[Any] = zmq.Context.instance()
        self._socket: zmq.Socket[bytes] | None = None
        try:
            self._socket = make_socket(context, zmq.SUB, _MAX_BYTES, _MAX_UNREAD, endpoint.find_keys())
        except EnlivenError:
            return  # The list of edges reports that the edge is not paired.
        self._socket.setsockopt(zmq.SUBSCRIBE, CAMERA.name.encode() + b"\0")
        self._socket.connect(endpoint.stream_address)

    def poll(self) -> None:
        """Reads the received images."""
        for _ in range(_MAX_UNREAD if self._socket is not None else 0):
            try:
                assert self._socket is not None
                topic, message = unpack_stream(b"".join(self._socket.recv_multipart(zmq.DONTWAIT)))
            except zmq.Again:
                return
            except MalformedMessageError:
                continue
            if topic is CAMERA:
                self.camera = message

    def close(self) -> None:
        """Closes the socket."""
        if self._socket is not None:
            self._socket.close(linger=0)
            self._socket = None
