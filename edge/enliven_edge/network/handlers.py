"""The table of handlers.

It defines the edge's action for each kind of order, and which orders replace each other.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any

from enliven.errors import EnlivenError
from enliven.wire import Answer, Done, Order, Refused
from enliven_edge.stage.stage_capacity import Peer


def _no_subject(order: Any) -> Hashable:
    """Returns None. It is the subject of orders that never replace each other."""
    return None


@dataclass(frozen=True)
class Handler:
    """The handling of one kind of order.

    Attributes:
        do: function that carries out the order and returns the answer, or None for "done". It raises an
            EnlivenError to refuse the order.
        takes_peer: True if ``do`` also gets the viewer.
        newest: returns the order's subject. Among a viewer's waiting orders with the same subject, only the
            newest is carried out. With the subject None, every order is carried out.

    The table of requests defines which viewers may send an order, see
    :func:`~enliven_edge.network.permissions.refusal_reason`.
    """

    do: Callable[..., Answer | None]
    newest: Callable[[Any], Hashable] = _no_subject
    takes_peer: bool = False

    def apply(self, order: Any, peer: Peer | None = None) -> Answer:
        """Carries out an order and returns the answer.

        ``peer`` is the viewer that sent it, or None for the edge itself.

        Raises:
            EnlivenError: if it is refused.
        """
        return (self.do(order, peer) if self.takes_peer else self.do(order)) or Done()


Handlers = Mapping[type[Order], Handler]


def execute(handlers: Handlers, order: Order, peer: Peer | None = None) -> Answer:
    """Carries out an order and returns the answer, which contains the reason if the order is refused.

    Args:
        peer: the viewer, for handlers that need it.
    """
    handler = handlers.get(type(order))
    if handler is None:
        return Refused("this edge does not support the request" if handlers else "the stream has ended")
    try:
        return handler.apply(order, peer)
    except EnlivenError as error:
        return Refused(str(error)[:400])


def find_subject(handlers: Handlers, order: Order) -> Hashable:
    """Returns the subject of an order. A newer order with the same subject replaces it.

    If the subject is None, the order is never replaced.
    """
    handler = handlers.get(type(order))
    subject = None if handler is None else handler.newest(order)
    return None if subject is None else (type(order), subject)
