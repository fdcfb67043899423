"""Sends the packets of one output by UDP."""

from __future__ import annotations

import socket

from enliven.outputs.address import Place
from enliven.outputs.live_frame import LiveFrame
from enliven.outputs.output import LiveOutput
from enliven.outputs.sender import Sender

_BUFFER_BYTES = 1 << 18
"""Size in bytes of the socket's send buffer. It can store several frames of the largest output."""


class UdpSender(Sender):
    """One output with its UDP socket.

    Args:
        name: name of the output, for messages.
        output: the object that converts frames to packets.
        family, place: address family and socket address of the receiver, see
            :func:`enliven.outputs.address.resolve`.
    """

    def __init__(self, name: str, output: LiveOutput, family: socket.AddressFamily, place: Place) -> None:
        super().__init__(name)
        self._output = output
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        self._place = place
        self._is_connected = False

    def close(self) -> None:
        """Closes the socket. A second call does nothing."""
        self._socket.close()

    def _send(self, frame: LiveFrame) -> None:
        for packet in self._output.encode_packets(frame):
            self._send_packet(packet)

    def _send_packet(self, packet: bytes) -> None:
        """Sends one packet, or counts it as lost. It never blocks."""
        try:
            if not self._is_connected:
                # A connected socket reports an error if no program listens on the receiver's port.
                self._socket.connect(self._place)
                self._is_connected = True
            try:
                self._socket.send(packet)
            except ConnectionRefusedError:
                # The error is the response to an earlier packet. The receiver may have started since then, so
                # send again.
                self._fail("no program receives packets at this address")
                self._socket.send(packet)
        except ConnectionRefusedError:
            pass
        except BlockingIOError:
            self._fail("the network is too slow for the packets")
        except OSError as error:
            self._is_connected = False
            self._fail(error.strerror or str(error))
        else:
            self.sent += 1
