"""The connection to the edges: receives published messages in order and without loss, and sends requests."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import zmq

from enliven.document import Character
from enliven.errors import InputError
from enliven.logs import escape_records
from enliven.wire import (
    Answer,
    Endpoint,
    Order,
    Refused,
    StatusMessage,
    Topic,
    parse_endpoint,
    warm_up,
)
from enliven_viewer.link.edge_connection import EdgeConnection
from enliven_viewer.link.received_data import Health, Notice
from enliven_viewer.link.stage_link import StageLink
from enliven_viewer.link.topic_health import TopicHealth

_HEARTBEAT_TIMEOUT_S = 1.6
"""Time without a heartbeat after which an edge of the same name no longer counts as a name clash, in seconds:
three heartbeat intervals.
"""


class EdgeClient:
    """A client that follows one or several edges. It is polled from the drawing thread and never blocks.

    It can be started before or after its edges, and edges may restart: characters and state are fetched
    automatically. Poses that arrive before their character are queued until it arrives. Call :meth:`poll`
    once per frame, then take the new values::

        link = Link(["127.0.0.1:5580"])
        while drawing:
            link.poll()
            for received in link.take(POSE):
                show(link.characters[received.pose.character], received.pose)

    With several edges, a character's id in this client is "edge/id". With one edge, it is the edge's own id,
    unless ``prefixed`` is set.

    The constructor compiles the pose decoder, which takes some seconds the first time on a machine.

    Args:
        endpoints: ``Endpoint``, or "host", "host:port" (the control port is the next one),
            "host:port:control_port".
        name: name of this viewer, sent to the edges.
        prefixed: True to use "edge/id" with a single edge too.
        prefix: returns the text before "/" for the name of an edge.
        forward: called from :meth:`poll` with each accepted stream message, see :class:`EdgeConnection`.

    Attributes:
        edges: one :class:`EdgeConnection` per endpoint, in the given order.

    Raises:
        InputError: if an address is invalid, or none is given.
    """

    def __init__(
        self,
        endpoints: Sequence[str | Endpoint] = (Endpoint(),),
        name: str = "viewer",
        *,
        prefixed: bool = False,
        prefix: Callable[[str], str] = lambda edge: edge,
        forward: Callable[[Any], None] = lambda message: None,
    ) -> None:
        escape_records()
        edge_endpoints = [parse_endpoint(e) if isinstance(e, str) else e for e in endpoints]
        edge_endpoints = list(dict.fromkeys(edge_endpoints))
        if not edge_endpoints:
            raise InputError(
                "no edge address was given", where="link", remedy="Pass an address such as 127.0.0.1:5580."
            )
        self._notices: deque[Notice] = deque(maxlen=200)
        self._heard: dict[tuple[str, int], tuple[float, float]] = {}
        self._prefix = prefix
        self._prefixed = is_prefixed = prefixed or len(edge_endpoints) > 1
        warm_up()

        def label(edge: str, character: str) -> str:
            return f"{prefix(edge)}/{character}" if is_prefixed else character

        # Use the process's shared context, because a separate one would wait for its sockets at garbage
        # collection.
        context: zmq.Context[Any] = zmq.Context.instance()
        self.edges = [
            EdgeConnection(context, e, name[:64], label, self._notices.append, forward)
            for e in edge_endpoints
        ]

    def poll(self) -> None:
        """Processes all received messages and requests missing data. Does not block."""
        for edge in self.edges:
            edge.poll()
        self._find_clashes()

    def wait(self, seconds: float) -> None:
        """Waits until a stream message can be read, but at most the given time in seconds."""
        poller = zmq.Poller()
        for edge in self.edges:
            poller.register(edge.socket, zmq.POLLIN)
        poller.poll(round(1000 * seconds))

    @property
    def characters(self) -> dict[str, Character]:
        """Returns the characters by id. An object is replaced when its edge publishes a new revision."""
        return {name: held.character for edge in self.edges for name, held in edge.characters.held.items()}

    def latest(self, topic: Topic) -> dict[str, Any]:
        """Returns the newest value of each key of a topic, such as the cues by character."""
        newest = [edge.values.latest.get(topic.name, {}) for edge in self.edges]
        return {key: value for values in newest for key, value in values.items()}

    @property
    def status(self) -> StatusMessage | None:
        """Returns the last heartbeat of the first edge with one, or None."""
        return next((e.status for e in self.edges if e.status is not None), None)

    @property
    def health(self) -> dict[Endpoint, Health]:
        """Returns the health of each edge, by endpoint."""
        return {edge.endpoint: edge.health() for edge in self.edges}

    @property
    def clock_offset_ns(self) -> int:
        """Returns the offset of the first edge's wall clock from this machine's in nanoseconds."""
        return self.edges[0].clock_offset_ns

    @property
    def topics(self) -> dict[Endpoint, dict[str, TopicHealth]]:
        """Returns the health of each topic of each edge: whether it is alive, at its rate and valid."""
        return {edge.endpoint: edge.topics() for edge in self.edges}

    @property
    def stage(self) -> StageLink:
        """Returns the link that puts characters onto the stage of the first edge."""
        return self.edges[0].stage

    def take(self, topic: Topic) -> list[Any]:
        """Returns the values of a topic received since the last call, in order for each edge. The topic's
        ``keep`` determines whether these are all values or only the newest of each key.
        """
        inboxes = [edge.values.inbox.get(topic.name) for edge in self.edges]
        return [value for inbox in inboxes if inbox is not None for value in inbox.take_all()]

    def take_notices(self) -> list[Notice]:
        """Returns messages for the user since the last call.

        They report refusals, restarts, version mismatches and name clashes.
        """
        return _empty_queue(self._notices)

    def ask(self, order: Order, on_reply: Callable[[Answer], None] | None = None) -> None:
        """Sends an order to the edge of its character, or to all edges. A notice reports a refusal.

        Args:
            order: the order, with the character's id as used here.
            on_reply: called from a later :meth:`poll` with Done or Refused; immediately if no edge has the
                character.
        """
        character = getattr(order, "character", None)
        if character is None:
            for edge in self.edges:
                edge.ask(order, on_reply)
            return
        for edge in self.edges:
            if character in edge.characters.held:
                prefix = f"{self._prefix(edge.name)}/" if self._prefixed else ""
                edge_order = msgspec.structs.replace(order, character=character.removeprefix(prefix))
                edge.ask(edge_order, on_reply)
                return
        character_names = ", ".join(self.characters) or "none"
        refusal = Refused(f"no edge has the character {character!r}; available: {character_names}"[:400])
        self._notices.append(Notice("warning", refusal.reason))
        if on_reply is not None:
            on_reply(refusal)

    def close(self) -> None:
        """Closes the sockets."""
        for edge in self.edges:
            edge.close()

    def _find_clashes(self) -> None:
        """Reports a name clash if two edges with the same name send messages at the same time. A restarted
        edge is not a clash, because its old process is silent.
        """
        now = time.monotonic()
        for edge in self.edges:
            if edge.status is not None and now - edge.last_heard < _HEARTBEAT_TIMEOUT_S:
                key = (edge.status.edge, edge.status.instance)
                first, _ = self._heard.get(key, (edge.last_heard, 0.0))
                self._heard[key] = (first, edge.last_heard)
        self._heard = {key: span for key, span in self._heard.items() if now - span[1] < _HEARTBEAT_TIMEOUT_S}
        for edge in self.edges:
            clash = edge.status is not None and self._has_rival(edge.status.edge, edge.status.instance)
            if clash and not edge.clash:
                text = f"two edges are named {edge.name!r}: start one of them with another --name"
                self._notices.append(Notice("error", text))
            edge.clash = clash

    def _has_rival(self, name: str, instance: int) -> bool:
        """Returns True if another instance of this name was alive at the same time as this one."""
        span = self._heard.get((name, instance))
        return span is not None and any(
            other[0] == name and other[1] != instance and max(first, span[0]) < min(last, span[1])
            for other, (first, last) in self._heard.items()
        )


def _empty_queue(queue: deque[Any]) -> list[Any]:
    """Empties a queue and returns its contents."""
    contents = list(queue)
    queue.clear()
    return contents
