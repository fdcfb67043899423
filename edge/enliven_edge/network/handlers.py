"""The table of handlers: what the edge does with each kind of order, how often, and for whom."""

from __future__ import annotations

import ipaddress
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from enliven.errors import EnlivenError
from enliven.wire import Answer, Done, Order, Refused
from enliven_edge.stage import Peer


def _each(order: Any) -> Hashable:
    """Returns None, the subject of orders that never replace one another."""
    return None


@dataclass(frozen=True)
class Handler:
    """How one kind of order is carried out.

    Attributes:
        do: carries it out; returns the answer, None for "done"; raises an EnlivenError where it is refused.
        takes_peer: whether ``do`` is called with the viewer, too.
        newest: returns its subject: of a viewer's waiting orders on one subject only the newest is carried
            out; None: this one counts in any case.
        who: may give it, all viewers that may connect or those of this machine alone.
    """

    do: Callable[..., Answer | None]
    newest: Callable[[Any], Hashable] = _each
    who: Literal["anyone", "this machine"] = "anyone"
    takes_peer: bool = False

    def apply(self, order: Any, peer: Peer | None = None) -> Answer:
        """Carries out an order of a viewer (None: of the edge itself); returns the answer.

        Raises:
            EnlivenError: where it is refused.
        """
        return (self.do(order, peer) if self.takes_peer else self.do(order)) or Done()


Handlers = Mapping[type[Order], Handler]


def carried_out(handlers: Handlers, order: Order, address: str, peer: Peer | None = None) -> Answer:
    """Carries out an order; returns the answer, of an order that is refused the reason.

    Args:
        address: the viewer's, without the port.
        peer: the viewer, for handlers that count for each.
    """
    handler = handlers.get(type(order))
    if handler is None:
        return Refused("this edge cannot do that" if handlers else "the stream has ended")
    if handler.who == "this machine" and not ipaddress.ip_address(address.partition("%")[0]).is_loopback:
        return Refused("only a viewer on the edge's own machine may ask for that")
    try:
        return handler.apply(order, peer)
    except EnlivenError as error:
        return Refused(str(error)[:400])


def subject_of(handlers: Handlers, order: Order) -> Hashable:
    """Returns the key of an order that a newer order with the same key replaces; None where each counts."""
    handler = handlers.get(type(order))
    subject = None if handler is None else handler.newest(order)
    return None if subject is None else (type(order), subject)
