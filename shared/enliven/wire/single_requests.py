"""Sends single requests to an edge without a viewer: pairing, the pairing code, and orders of operators."""

from __future__ import annotations

import time
from typing import Any, TypeVar

import zmq

from enliven.errors import InputError, ResourceError
from enliven.keys.client import ClientKeys
from enliven.keys.key_files import KeyStore, PairedEdge, make_key_pair
from enliven.keys.pairing import Introduction, PairingError, ViewerPairing
from enliven.keys.roles import Role
from enliven.wire.envelope import MalformedMessageError, pack_control, unpack_control
from enliven.wire.requests import (
    Ask,
    Done,
    FinishPairing,
    Order,
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
"""Maximum size in bytes of a reply. The longest reply, to a pairing request, has 600 bytes."""
_MAX_UNREAD = 16
"""Maximum number of unread replies."""
_ANSWER_TIMEOUT_S = 5.0
"""Timeout of each request, in seconds. It is generous, because an edge answers within a frame."""

T = TypeVar("T")


def pair_with_edge(endpoint: Endpoint, code: str, role: Role, name: str, store: KeyStore) -> PairedEdge:
    """Pairs with an edge, and stores its key.

    If this user has no keys yet, new keys are stored, too. A failed pairing stores nothing, because otherwise
    an edge of this user would require keys from its next start on.

    Args:
        code: the six digits that the edge shows.
        role: the requested role. The edge may grant a lower one.
        name: the name under which the edge lists this viewer.

    Raises:
        InputError: if the code is wrong or expired, or the edge currently refuses pairing.
        ResourceError: if no edge answers.
    """
    stored_keys = store.load_own_pair()
    own_keys = stored_keys or make_key_pair()
    with _RequestSocket(endpoint) as asker:
        try:
            exchange = ViewerPairing(code)
            pairing_started = asker.request(StartPairing(exchange.message), PairingStarted)
            box = exchange.encrypt_introduction(
                pairing_started.message, Introduction(own_keys.public, name, role)
            )
            edge = exchange.decrypt_introduction(asker.request(FinishPairing(box), Paired).box)
        except PairingError as error:
            raise InputError(str(error), where=str(endpoint), remedy=_TRANSIENT_ERRORS) from None
    paired_edge = PairedEdge(edge.public, edge.name, endpoint.host, endpoint.control_port, edge.role)
    if stored_keys is None:
        store.store_own(own_keys)
    store.add_edge(paired_edge)
    return paired_edge


def show_pairing_code(endpoint: Endpoint) -> tuple[str, int]:
    """Opens pairing on an edge. Returns its code and the seconds until the code expires.

    The code is empty during a pause after too many tries. Then the seconds are the time until a new code is
    available.

    Raises:
        InputError: if this viewer is not paired with the edge, or does not have the role *operate*.
        ResourceError: if no edge answers.
    """
    with _RequestSocket(endpoint, endpoint.find_keys()) as asker:
        shown_code = asker.request(ShowCode(), ShownCode)
    return shown_code.code, shown_code.seconds


def send_order(endpoint: Endpoint, order: Order) -> str:
    """Sends an order to an edge, and returns its note about the result, which may be empty.

    Raises:
        InputError: if the edge refuses the order, for example because this viewer's role is too low.
        ResourceError: if no edge answers.
    """
    with _RequestSocket(endpoint, endpoint.find_keys()) as asker:
        return asker.request(order, Done).note


_TRANSIENT_ERRORS = (
    "Read the code on the edge again. The code changes after three tries and after five minutes."
)


class _RequestSocket:
    """A connection that sends requests and waits for their answers."""

    def __init__(self, endpoint: Endpoint, keys: ClientKeys | None = None) -> None:
        self._endpoint, self._number = endpoint, 0
        context: zmq.Context[Any] = zmq.Context.instance()
        self._socket = make_socket(context, zmq.DEALER, _MAX_REPLY_BYTES, _MAX_UNREAD, keys)
        self._socket.connect(endpoint.control_address)

    def __enter__(self) -> _RequestSocket:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close(linger=0)

    def request(self, body: Ask, kind: type[T]) -> T:
        """Sends a request and returns its answer, which must be an instance of ``kind``."""
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
            raise ResourceError("the edge sent an unexpected answer", where=f"the edge at {self._endpoint}")
        raise ResourceError(
            f"no edge answered for {_ANSWER_TIMEOUT_S:g} s",
            where=str(self._endpoint),
            remedy="Start the edge on its computer: enliven edge --host 0.0.0.0. Check the address and the "
            "firewall.",
        )
