"""A UDP port that receives OSC, and collects the messages of one frame from several packets."""

from __future__ import annotations

import socket
import time
from collections.abc import Hashable, Iterator

from pythonosc.osc_packet import OscPacket, ParseError

from enliven.errors import InputError, ResourceError
from enliven_edge.closeable import Closeable

_MAX_PACKET_BYTES = 65_536
"""Largest UDP packet."""
_QUIET_S = 0.004
"""Seconds without a packet after which a frame is complete. Senders write the packets of a frame at once."""
_MAX_FRAME_S = 0.05
"""Longest time in seconds to collect one frame, for senders that never pause."""
_BUFFER_BYTES = 1 << 20
"""Size of the system's receive buffer: some frames wait while the edge works."""
Message = tuple[str, list[object]]
"""An OSC address and its arguments."""


class OscPort(Closeable):
    """Receives OSC messages frame by frame.

    Args:
        host: the address to listen on. "0.0.0.0" also accepts other machines.
        port: the UDP port. 0 picks a free one.
        where: the sensor, for messages.

    Attributes:
        malformed: number of packets that were not OSC.

    Raises:
        InputError: for a number that is not a port.
        ResourceError: for a port in use, or an address that does not belong to this machine.
    """

    def __init__(self, host: str, port: int, where: str) -> None:
        if not 0 <= port <= 65535:
            raise InputError(f"{port} is not a UDP port", where=where, mend="Set port to 1 to 65535.")
        self.malformed = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            mend = "End the other program that listens there, or set another port, also in the sender."
            problem = f"port {port} of {host} cannot be opened ({error.strerror})"
            raise ResourceError(problem, where=where, mend=mend) from None
        self.port: int = self._socket.getsockname()[1]
        self._early: list[Message] = []

    def frame(self, timeout: float | None) -> list[Message]:
        """Returns the messages of one frame: up to a pause of the sender, or until a message repeats.

        Raises:
            TimeoutError: if nothing came in time.
        """
        messages, self._early = self._early, []
        names = {_name_of(message) for message in messages}
        if not messages:
            messages = list(self._receive(timeout))
            names = {_name_of(message) for message in messages}
        end = time.monotonic() + _MAX_FRAME_S
        while time.monotonic() < end:
            try:
                more = list(self._receive(_QUIET_S))
            except TimeoutError:
                break
            if any(_name_of(message) in names for message in more):
                self._early = more
                break
            messages += more
            names.update(map(_name_of, more))
        return messages

    def close(self) -> None:
        self._socket.close()

    def _receive(self, timeout: float | None) -> Iterator[Message]:
        """Yields the messages of the next packet. A packet that is not OSC is counted, and yields nothing."""
        self._socket.settimeout(timeout)
        data = self._socket.recv(_MAX_PACKET_BYTES)
        try:
            messages = [
                (each.message.address, list(each.message.params)) for each in OscPacket(data).messages
            ]
        except (ParseError, ValueError, IndexError):
            self.malformed += 1
            return
        yield from messages


def _name_of(message: Message) -> Hashable:
    """Returns the name of a message within a frame: its address, with its first argument if it is a text."""
    address, arguments = message
    return (address, arguments[0]) if arguments and isinstance(arguments[0], str) else address
