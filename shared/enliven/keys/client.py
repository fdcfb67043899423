"""The viewer's side of an encrypted connection: its keys, and the reason why a connection fails."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import zmq
from zmq.utils import z85

from enliven.errors import InputError
from enliven.keys.key_files import KeyPair, KeyStore

HandshakeProblem = Literal["", "not paired", "other key", "needs keys", "has no keys"]
"""The reason why an edge rejects a viewer. "not paired": the edge does not know the viewer's key. "other
key": the edge has a different key than the stored one. "needs keys": the edge accepts only paired viewers,
and this viewer is not paired. "has no keys": the viewer expects encryption, but the edge does not use keys.
Empty: no problem is known.
"""
_EVENTS = (
    zmq.EVENT_HANDSHAKE_SUCCEEDED
    | zmq.EVENT_HANDSHAKE_FAILED_AUTH
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
)
_MAX_EVENTS_PER_POLL = 32
"""Maximum number of socket events that one call of :meth:`HandshakeWatch.poll` reads."""


@dataclass(frozen=True)
class ClientKeys:
    """The keys of a viewer for one edge.

    Attributes:
        server: the edge's public key. An edge with another key is rejected.
        key_pair: the viewer's key pair.
    """

    server: bytes
    key_pair: KeyPair

    def encrypt_socket(self, socket: zmq.Socket[Any]) -> None:
        """Enables encryption on a socket, and makes it accept only the edge with the expected key. Call it
        before the socket connects."""
        socket.curve_serverkey = z85.encode(self.server)
        socket.curve_publickey = z85.encode(self.key_pair.public)
        socket.curve_secretkey = z85.encode(self.key_pair.secret)


def find_client_keys(host: str, control_port: int, folder: Path | None = None) -> ClientKeys | None:
    """Returns the keys for the edge at an address, or None if this user is not paired with it.

    Args:
        folder: the folder of the key files. None means the user's folder.

    Raises:
        InputError: if a key file is missing, damaged, or readable by other users.
    """
    store = KeyStore(folder)
    server = store.server_key(host, control_port)
    if server is None:
        return None
    own_keys = store.load_own_pair()
    if own_keys is None:
        raise InputError(
            f"the edge at {host} is paired, but the keys of this computer are missing",
            where=str(store.own_path),
            remedy="Restore the file, or pair again: enliven pair HOST CODE.",
        )
    return ClientKeys(server, own_keys)


class HandshakeMonitor:
    """A monitor that reports why the connections of a viewer's socket fail. Create it before the socket
    connects.

    Args:
        uses_keys: True if the socket has keys.

    Attributes:
        problem: the latest problem. Empty after a successful handshake.
    """

    def __init__(self, socket: zmq.Socket[Any], uses_keys: bool) -> None:
        self._socket, self._uses_keys = socket, uses_keys
        self._monitor = socket.get_monitor_socket(_EVENTS)
        self.problem: HandshakeProblem = ""

    def poll(self) -> None:
        """Reads the socket events since the last call without blocking."""
        # Import it here, because it imports asyncio, which an edge does not need.
        from zmq.utils.monitor import recv_monitor_message

        for _ in range(_MAX_EVENTS_PER_POLL):
            try:
                event = recv_monitor_message(self._monitor, zmq.DONTWAIT)
            except zmq.ZMQError:
                return
            self.problem = self._problem_from_event(int(event["event"]), int(event["value"]))

    def close(self) -> None:
        """Stops the monitor. Call it before the socket is closed."""
        with contextlib.suppress(zmq.ZMQError):
            self._socket.disable_monitor()
        self._monitor.close(linger=0)

    def _problem_from_event(self, event: int, value: int) -> HandshakeProblem:
        """Returns the problem that an event of libzmq indicates."""
        if event == zmq.EVENT_HANDSHAKE_FAILED_AUTH:
            return _STATUS_PROBLEMS.get(value, "not paired")
        if event == zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL:
            if value == zmq.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH:
                return "has no keys" if self._uses_keys else "needs keys"
            # The edge does not have the key that this viewer expects.
            return "other key" if self._uses_keys else ""
        return "" if event == zmq.EVENT_HANDSHAKE_SUCCEEDED else self.problem


def handshake_advice(problem: HandshakeProblem, host: str) -> str:
    """Returns the rest of a sentence for the user about a problem. The sentence begins with "the edge at
    ADDRESS"."""
    return _ADVICE[problem].format(host=host) if problem else ""


_STATUS_PROBLEMS: dict[int, HandshakeProblem] = {400: "not paired", 500: "other key"}
"""The problem for each status that the edge sends. See :mod:`enliven.keys.curve`."""
_ADVICE: dict[str, str] = {
    "not paired": "does not know this viewer's key. Pair the viewer: enliven pair {host} CODE",
    "other key": "has another key than this viewer expects. If enliven was installed again "
    "on the edge's computer, pair again: enliven pair {host} CODE. Otherwise another program may "
    "answer at this address",
    "needs keys": "accepts only paired viewers. Pair this viewer with the code that the edge shows: "
    "enliven pair {host} CODE",
    "has no keys": "uses no keys, but this viewer has a key of the edge. Start the edge again without "
    "--insecure, or remove the edge's key on this computer: enliven keys forget {host}",
}
