"""Pairs this user's viewers with an edge by its code, over the edge's port of commands."""

from __future__ import annotations

import time
from typing import Any, TypeVar

import zmq

from enliven.errors import InputError, ResourceError
from enliven.keys import (
    ClientKeys,
    Introduction,
    KeyStore,
    PairedEdge,
    PairingError,
    Role,
    ViewerExchange,
    make_key_pair,
)
from enliven.wire.envelope import MalformedMessageError, pack_control, unpack_control
from enliven.wire.requests import (
    Ask,
    FinishPairing,
    Paired,
    PairingStarted,
    Refused,
    Request,
    ShowCode,
    ShownCode,
    StartPairing,
)
from enliven.wire.sockets import Endpoint, make_socket
from enliven.wire.topics import REPLY

_MAX_REPLY_BYTES = 64 * 1024
"""Maximum bytes of a reply about pairing. The longest one has 600."""
_MAX_UNREAD = 16
"""Maximum number of unread replies."""
_ANSWER_TIMEOUT_S = 5.0
"""Timeout of each request, in seconds. An edge answers within a frame."""

T = TypeVar("T")


def pair_with_edge(endpoint: Endpoint, code: str, role: Role, name: str, store: KeyStore) -> PairedEdge:
    """Pairs with an edge, and stores its key.

    If this user has no keys, new ones are stored, too. A failed pairing stores nothing: with keys, an edge of
    this user would start locked.

    Args:
        code: the six digits that the edge shows.
        role: the requested role. The edge may grant a lower one.
        name: the name under which the edge lists this viewer.

    Raises:
        InputError: if the code is wrong or expired, or the edge does not pair now.
        ResourceError: if no edge answers.
    """
    stored = store.own()
    own = stored or make_key_pair()
    with _Asker(endpoint) as asker:
        try:
            exchange = ViewerExchange(code)
            started = asker.ask(StartPairing(exchange.message), PairingStarted)
            box = exchange.introduce(started.message, Introduction(own.public, name, role))
            edge = exchange.read(asker.ask(FinishPairing(box), Paired).box)
        except PairingError as error:
            raise InputError(str(error), where=str(endpoint), mend=_READ_AGAIN) from None
    paired = PairedEdge(edge.public, edge.name, endpoint.host, endpoint.control_port, edge.role)
    if stored is None:
        store.store_own(own)
    store.add_edge(paired)
    return paired


def show_pairing_code(endpoint: Endpoint) -> tuple[str, int]:
    """Opens pairing on an edge. Returns its code and the seconds until the code expires.

    The code is empty during a pause after too many tries. Then the seconds are those until a new code.

    Raises:
        InputError: if this viewer has no key of the edge, or not the role *operate*.
        ResourceError: if no edge answers.
    """
    with _Asker(endpoint, endpoint.find_keys()) as asker:
        shown = asker.ask(ShowCode(), ShownCode)
    return shown.code, shown.seconds


_READ_AGAIN = "Read the code on the edge again: it changes after three tries and after five minutes."


class _Asker:
    """A socket that sends a request and waits for its answer."""

    def __init__(self, endpoint: Endpoint, keys: ClientKeys | None = None) -> None:
        self._endpoint, self._number = endpoint, 0
        context: zmq.Context[Any] = zmq.Context.instance()
        self._socket = make_socket(context, zmq.DEALER, _MAX_REPLY_BYTES, _MAX_UNREAD, keys)
        self._socket.connect(endpoint.control_address)

    def __enter__(self) -> _Asker:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close(linger=0)

    def ask(self, body: Ask, kind: type[T]) -> T:
        """Sends a request and returns the answer, which must be of a kind."""
        self._number += 1
        self._socket.send(pack_control(Request(self._number, body)))
        end = time.monotonic() + _ANSWER_TIMEOUT_S
        while (left := end - time.monotonic()) > 0:
            if not self._socket.poll(max(round(1000 * left), 1)):
                break
            try:
                reply = unpack_control(b"".join(self._socket.recv_multipart()), REPLY)
            except MalformedMessageError as error:
                raise ResourceError(str(error), where=str(self._endpoint)) from None
            if reply.id not in (0, self._number):
                continue
            if isinstance(reply.body, Refused):
                raise InputError(reply.body.reason, where=f"the edge at {self._endpoint}")
            if isinstance(reply.body, kind):
                return reply.body
            raise ResourceError("it answers something else", where=f"the edge at {self._endpoint}")
        raise ResourceError(
            f"no edge answered for {_ANSWER_TIMEOUT_S:g} s",
            where=str(self._endpoint),
            mend="Start it there: enliven edge --host 0.0.0.0. Check address and firewall.",
        )
