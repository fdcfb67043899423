"""The link to the edges: what they publish, in order and without loss, and the requests to them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import zmq

from enliven.document import Character, Props
from enliven.errors import InputError
from enliven.matching import Board
from enliven.wire import (
    Answer,
    Browse,
    Endpoint,
    Lock,
    Look,
    Mode,
    Possess,
    Refused,
    Release,
    Smooth,
    StatusMessage,
    parse_endpoint,
    warm_up,
)
from enliven_viewer.link.one_edge import EdgeConnection
from enliven_viewer.link.received import Health, Notice, ReceivedBodies, ReceivedCues, ReceivedPose

_ALIVE = 1.6
"""Seconds without a heartbeat (three of them) after which an edge of the same name is not a rival."""


class EdgeClient:
    """Follows one edge or several: polled from the thread that draws, it never waits.

    Start it before or after its edges, and restart them as you like: characters and state are fetched by
    themselves. Poses that arrive before their character wait for it. Call :meth:`poll` once a frame, then
    take what is new::

        link = Link(["127.0.0.1:5580"])
        while drawing:
            link.poll()
            for received in link.take_poses():
                show(link.characters[received.pose.character], received.pose)

    With several edges a character's id is "edge/id" here, with one it is the id that the edge gave it.

    Making one compiles the decoder of poses, which takes some seconds the first time on a machine.

    Args:
        endpoints: ``Endpoint``, or "host", "host:port" (commands one port on), "host:port:control_port".
        name: of this viewer, for the edges.

    Attributes:
        edges: one :class:`EdgeConnection` an endpoint, in the order given.

    Raises:
        InputError: for an address that is none, or no address at all.
    """

    def __init__(self, endpoints: Sequence[str | Endpoint] = (Endpoint(),), name: str = "viewer") -> None:
        found = [parse_endpoint(e) if isinstance(e, str) else e for e in endpoints]
        found = list(dict.fromkeys(found))
        if not found:
            raise InputError(
                "no edge to link to", where="link", mend="Give an address, such as 127.0.0.1:5580."
            )
        self._context: zmq.Context[Any] = zmq.Context()
        self._notices: deque[Notice] = deque(maxlen=200)
        self._heard: dict[tuple[str, int], tuple[float, float]] = {}
        several = len(found) > 1
        warm_up()

        def label(edge: str, character: str) -> str:
            return f"{edge}/{character}" if several else character

        self.edges = [EdgeConnection(self._context, e, name[:64], label, self._notices.append) for e in found]

    def poll(self) -> None:
        """Take in everything that has arrived and ask for what is missing; returns at once."""
        for edge in self.edges:
            edge.poll()
        self._find_clashes()

    @property
    def characters(self) -> dict[str, Character]:
        """The characters by id; an object is replaced when its edge publishes a new revision."""
        return {name: held.character for edge in self.edges for name, held in edge.held.items()}

    @property
    def cues(self) -> dict[str, ReceivedCues]:
        """The newest by character."""
        return {name: cues for edge in self.edges for name, cues in edge.cues.items()}

    @property
    def bodies(self) -> ReceivedBodies | None:
        """The newest bodies of the first edge that has sent any."""
        return next((e.latest_bodies for e in self.edges if e.latest_bodies is not None), None)

    @property
    def status(self) -> StatusMessage | None:
        """The last heartbeat of the first edge that was heard, or None."""
        return next((e.status for e in self.edges if e.status is not None), None)

    @property
    def health(self) -> dict[Endpoint, Health]:
        """The health of each edge, by endpoint."""
        return {edge.endpoint: edge.health() for edge in self.edges}

    @property
    def clock_offset_ns(self) -> int:
        """The first edge's wall clock less this machine's, as ``ClockEstimate`` has it."""
        return self.edges[0].clock.offset_ns

    def take_poses(self) -> list[ReceivedPose]:
        """Every pose since the last call, each edge's in its order."""
        return [pose for edge in self.edges for pose in _emptied(edge.poses)]

    def take_bodies(self) -> list[ReceivedBodies]:
        """The bodies of every frame since the last call, each edge's in its order."""
        return [bodies for edge in self.edges for bodies in _emptied(edge.bodies)]

    def take_cues(self) -> list[ReceivedCues]:
        """The cues of every frame since the last call, each edge's in its order."""
        return [cues for edge in self.edges for cues in _emptied(edge.new_cues)]

    def take_props(self) -> list[Props]:
        """The props of every frame since the last call, each edge's in its order."""
        return [props for edge in self.edges for props in _emptied(edge.props)]

    def take_boards(self) -> list[Board]:
        """The boards of matches of every frame since the last call, each edge's in its order."""
        return [board for edge in self.edges for board in _emptied(edge.boards)]

    def look(self, look: Look) -> None:
        """Tell every connected edge the viewer's direction of view."""
        for edge in self.edges:
            if edge.status is not None:
                edge.command(look, None)

    def browse(self, character: str, step: int = 1) -> None:
        """Ask for another match of a character to be shown; step 0 follows the pose again."""
        self._command(character, lambda own: Browse(own, step), None)

    def take_notices(self) -> list[Notice]:
        """Sentences for the user since the last call: refusals, restarts, other versions, clashes."""
        return _emptied(self._notices)

    def possess(
        self,
        character: str,
        body: int | None = None,
        parts: str = "all",
        on_reply: Callable[[Answer], None] | None = None,
        mode: Mode = "alone",
    ) -> None:
        """Ask the edge to let a body possess a character; a refusal comes as a notice.

        Args:
            body: the performer's id; None: the performer in view.
            parts: names of :data:`enliven.person.body.PARTS`, joined with "+".
            on_reply: called from a later :meth:`poll` with Done or Refused; at once without an edge.
            mode: who else holds it then, see :class:`~enliven.wire.messages.Possess`.
        """
        self._command(character, lambda own: Possess(own, body, parts, mode), on_reply)

    def release(
        self,
        character: str,
        on_reply: Callable[[Answer], None] | None = None,
        body: int | None = None,
    ) -> None:
        """Ask for a character to be released by a performer, or by every performer; see :meth:`possess`."""
        self._command(character, lambda own: Release(own, body), on_reply)

    def smooth(
        self, body: int, amount: float | None = None, on_reply: Callable[[Answer], None] | None = None
    ) -> None:
        """Ask for an amount of smoothing of a performer: 0 for none, None for the settings."""
        for edge in self.edges:
            edge.command(Smooth(body, amount), on_reply)

    def lock(self, on: bool, on_reply: Callable[[Answer], None] | None = None) -> None:
        """Ask that only the performers who are followed now perform, or with False all who come."""
        for edge in self.edges:
            edge.command(Lock(on), on_reply)

    def close(self) -> None:
        """Let the sockets go."""
        for edge in self.edges:
            edge.close()
        self._context.destroy(linger=0)

    def _command(
        self,
        character: str,
        request: Callable[[str], Possess | Release | Browse],
        on_reply: Callable[[Answer], None] | None,
    ) -> None:
        """Send a command to the edge that has the character."""
        for edge in self.edges:
            if character in edge.held:
                own = character if len(self.edges) == 1 else character.removeprefix(f"{edge.name}/")
                edge.command(request(own), on_reply)
                return
        known = ", ".join(self.characters) or "none"
        refused = Refused(f"there is no character {character!r}; known: {known}"[:400])
        self._notices.append(Notice("warning", refused.reason))
        if on_reply is not None:
            on_reply(refused)

    def _find_clashes(self) -> None:
        """Mark edges of one name that are alive at once; after a restart the old one is silent."""
        now = time.monotonic()
        for edge in self.edges:
            if edge.status is not None and now - edge.last_heard < _ALIVE:
                key = (edge.status.edge, edge.status.instance)
                first, _ = self._heard.get(key, (edge.last_heard, 0.0))
                self._heard[key] = (first, edge.last_heard)
        self._heard = {key: span for key, span in self._heard.items() if now - span[1] < _ALIVE}
        for edge in self.edges:
            clash = edge.status is not None and self._has_rival(edge.status.edge, edge.status.instance)
            if clash and not edge.clash:
                text = f"two edges are named {edge.name!r}: give one another name with --name"
                self._notices.append(Notice("error", text))
            edge.clash = clash

    def _has_rival(self, name: str, instance: int) -> bool:
        """Whether another instance of this name was heard between the first and last word of this one."""
        span = self._heard.get((name, instance))
        return span is not None and any(
            other[0] == name and other[1] != instance and max(first, span[0]) < min(last, span[1])
            for other, (first, last) in self._heard.items()
        )


def _emptied(queue: deque[Any]) -> list[Any]:
    """Empty a queue and return what was in it."""
    taken = list(queue)
    queue.clear()
    return taken
