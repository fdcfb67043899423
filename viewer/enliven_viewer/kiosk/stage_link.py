"""The kiosk's connection to its edges: receives visitors, control of characters and buttons, and sends the
story's requests.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from enliven.document import Character
from enliven.kiosk.profile import KioskEdge, KioskProfile
from enliven.kiosk.spot import Press, StoryRequest, TakeCharacter
from enliven.kiosk.visitors import Visitor, visitor_from_body
from enliven.person import Body
from enliven.samples.shipped import default_parts
from enliven.space.space_file import load_space
from enliven.wire import BODIES, CALLS, HOLDS, Done, Possess, Release, Topic
from enliven_viewer.kiosk.visitor_merge import VisitorMerge
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.live.followed_edge import FollowedEdge, find_shared_performer_id, split_performer_id
from enliven_viewer.live.shared_space import SharedSpace
from enliven_viewer.render.scene import SceneCharacter
from enliven_viewer.settings import PlaybackSettings

log = logging.getLogger(__name__)

_SILENCE_S = 1.0
"""Seconds without a message about bodies after which no visitor counts as present. Edges send such a message
for every frame of the sensor, even if it lists no body.
"""
_MEMORY_MIN = 0.1
"""Length of the timeline in minutes. The kiosk shows only the newest moment."""
PRESSES: Mapping[str, Press] = {"record": "take", "stop": "leave", "again": "next"}
"""The kiosk's button for each control call of an edge."""


@dataclass(frozen=True)
class EdgeReport:
    """The report of all edges in one frame.

    Attributes:
        is_connected: True while an edge answers and its sensor delivers.
        visitors: the tracked people.
        bodies: their bodies by tracking id.
        presses: pressed buttons.
        holders: the tracking ids of the bodies that control each character, by its name.
        characters: the characters on the stage.
        shown: the characters in their newest poses.
        problem: one sentence for operators; empty if all is well.
    """

    is_connected: bool = False
    visitors: tuple[Visitor, ...] = ()
    bodies: Mapping[int, Body] = field(default_factory=dict)
    presses: tuple[Press, ...] = ()
    holders: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    characters: Mapping[str, Character] = field(default_factory=dict)
    shown: Mapping[str, SceneCharacter] = field(default_factory=dict)
    problem: str = ""


def find_edge_addresses(profile: KioskProfile) -> list[str]:
    """Returns the addresses of the profile's edges, in its order."""
    return [find_edge_address(edge) for edge in profile.edges.values()]


def find_edge_address(edge: KioskEdge) -> str:
    """Returns the address of an edge of the profile."""
    if not edge.address:
        return f"127.0.0.1:{edge.port}"
    return edge.address if ":" in edge.address else f"{edge.address}:{edge.port}"


def find_parts(profile: KioskProfile) -> dict[str, str]:
    """Returns the body parts that control each character, by its name."""
    return {
        name: character.parts or default_parts(character.mesh)
        for name, character in profile.characters.items()
    }


class KioskLink:
    """The connection to the edges of a kiosk. It transforms their visitors and characters into one space.

    Each edge has all characters of the profile. A visitor controls the character on the edge that tracks the
    visitor. The picture shows the character in that edge's pose.

    Args:
        profile: the kiosk.
        folder: folder of the profile, for relative paths.
        clients: clients that replace those of the profile's edges, one for each edge; used by tests.
        clock: returns monotonic time in seconds.

    Raises:
        InputError: if the file with the places of the edges is wrong.
    """

    def __init__(
        self,
        profile: KioskProfile,
        folder: Path,
        clients: Sequence[EdgeClient] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock, self._parts, self._names = clock, find_parts(profile), list(profile.edges)
        links = clients or [
            EdgeClient([address], name=profile.name) for address in find_edge_addresses(profile)
        ]
        settings = PlaybackSettings(minutes=_MEMORY_MIN)
        self._edges = [ShowEdge(client, k, settings, clock) for k, client in enumerate(links)]
        self._space = SharedSpace(self._report)
        self._problems: list[str] = []
        if len(self._edges) > 1:
            for edge in self._edges:
                edge.client.edges[0].align_clock()
            if profile.zone.space:
                self._space.space = load_space(folder / profile.zone.space)
        self._merge = VisitorMerge()
        self._owners: dict[str, int] = {}

    def advance(self, seconds: float) -> EdgeReport:
        """Processes all received messages. Returns the state of the edges."""
        self._receive(seconds)
        presses = tuple(press for edge in self._edges for press in edge.take_presses())
        problem = next((text for edge in self._edges if (text := edge.problem)), "")
        problem = problem or " ".join(self._problems)
        characters = {
            name: character
            for edge in reversed(self._edges)
            for name, character in edge.live.document.characters.items()
        }
        seeing = [edge for edge in self._edges if edge.is_delivering and self._is_placed(edge)]
        if not seeing:
            return EdgeReport(False, presses=presses, characters=characters, problem=problem)
        holders = self._find_holders(seeing)
        held = {body for bodies in holders.values() for body in bodies}
        bodies = self._merge.merge({edge.number: edge.live.scene.bodies for edge in seeing}, held)
        visitors = tuple(v for v in map(visitor_from_body, bodies.values()) if v is not None)
        shown = self._find_shown(seeing, holders)
        return EdgeReport(True, visitors, bodies, presses, holders, characters, shown, problem)

    def send(self, requests: Sequence[StoryRequest]) -> None:
        """Sends the story's requests to the edges. Refusals are logged for operators."""
        for request in requests:
            if isinstance(request, TakeCharacter):
                self._give_character(request.character, *split_performer_id(request.body))
            elif request.body is None:
                for edge in self._edges:
                    self._release_character(edge, request.character, None)
            else:
                number, body = split_performer_id(request.body)
                self._release_character(self._edges[number], request.character, body)

    def close(self) -> None:
        """Closes the sockets."""
        for edge in self._edges:
            edge.close()

    def _receive(self, seconds: float) -> None:
        """Processes the messages of all edges, and makes the scene of each edge for the same moment."""
        if len(self._edges) > 1:
            self._space.update_transforms(self._find_edge_name(0), self._edges[1:])
        for edge in self._edges:
            edge.receive(seconds)
        self._space.align_times([(edge.live, edge.feed) for edge in self._edges])
        for edge in self._edges:
            edge.live.compose(seconds)

    def _find_edge_name(self, number: int) -> str:
        """Returns the name that an edge has sent, or the name in the profile before its first message."""
        edge = self._edges[number]
        return edge.name if edge.is_heard or number >= len(self._names) else self._names[number]

    def _is_placed(self, edge: ShowEdge) -> bool:
        """Returns True if the visitors of an edge have correct positions in the shared space.

        If the kiosk has a calibration file, an edge that it does not contain is ignored. Its visitors would
        be at wrong positions.
        """
        return edge.number == 0 or self._space.space is None or edge.feed.transform is not None

    def _find_holders(self, edges: Sequence[ShowEdge]) -> dict[str, tuple[int, ...]]:
        """Returns the shared ids of the bodies that control each character on any edge."""
        holders: dict[str, tuple[int, ...]] = {}
        for edge in edges:
            for name, bodies in edge.holders.items():
                shared = tuple(find_shared_performer_id(edge.number, body) for body in bodies)
                holders[name] = (*holders.get(name, ()), *shared)
        return holders

    def _find_shown(
        self, edges: Sequence[ShowEdge], holders: Mapping[str, tuple[int, ...]]
    ) -> dict[str, SceneCharacter]:
        """Returns each character in its newest pose, on the edge that tracks the visitor who controls it."""
        shown: dict[str, SceneCharacter] = {}
        for edge in reversed(edges):
            shown |= {actor.character.id: actor for actor in edge.live.scene.actors}
        by_number = {edge.number: edge for edge in edges}
        for name, bodies in holders.items():
            numbers = [split_performer_id(body)[0] for body in bodies]
            owner = self._owners.get(name, -1)
            edge = by_number.get(owner if owner in numbers else next(iter(numbers), -1))
            actors = () if edge is None else edge.live.scene.actors
            shown |= {actor.character.id: actor for actor in actors if actor.character.id == name}
        return shown

    def _give_character(self, character: str, number: int, body: int) -> None:
        """Lets a visitor control a character on the edge that tracks the visitor, and releases it on all
        other edges.
        """
        self._owners[character] = number
        for edge in self._edges:
            if edge.number == number:
                edge.ask(Possess(character, body, self._parts.get(character, "all"), "alone"))
            elif edge.holders.get(character):
                self._release_character(edge, character, None)

    def _release_character(self, edge: ShowEdge, character: str, body: int | None) -> None:
        """Releases a character on an edge. Sends nothing if no visitor controls it there."""
        if body is not None or edge.number == 0 or edge.holders.get(character):
            edge.ask(Release(character, body))

    def _report(self, problem: str, remedy: str) -> None:
        """Stores a sentence for operators about the calibrated positions of the edges."""
        self._problems.append(f"{problem}. {remedy}")


class ShowEdge(FollowedEdge):
    """One edge of a kiosk.

    Args:
        clock: returns monotonic time in seconds.
    """

    def __init__(
        self, client: EdgeClient, number: int, settings: PlaybackSettings, clock: Callable[[], float]
    ) -> None:
        super().__init__(client, number, settings)
        self.feed.on_message = self._record_message
        self._clock, self._bodies_at = clock, -_SILENCE_S
        self._presses: list[Press] = []

    @property
    def is_delivering(self) -> bool:
        """Returns True if the edge answers and its sensor delivers."""
        return self.connected and self._clock() - self._bodies_at < _SILENCE_S

    @property
    def problem(self) -> str:
        """Returns a sentence about the edge for operators, or an empty text if all is well."""
        edge = self.live.document.edge
        if not edge.connected:
            return f"the edge at {edge.address} does not answer"
        if not self.is_delivering:
            return f"the camera of the edge {self.name} sends no data"
        return edge.health[0].what if edge.health and edge.health[0].severity > 1 else ""

    @property
    def holders(self) -> Mapping[str, tuple[int, ...]]:
        """Returns this edge's ids of the bodies that control each character."""
        return {name: tuple(hold.holders) for name, hold in self.client.latest(HOLDS).items()}

    def take_presses(self) -> list[Press]:
        """Returns the buttons that were pressed at this edge since the last call."""
        presses, self._presses = self._presses, []
        return presses

    def ask(self, order: Possess | Release) -> None:
        """Sends a request. A refusal is logged for operators."""
        self.client.ask(order, lambda answer: _log_refusal(order, answer))

    def _record_message(self, topic: Topic, value: Any) -> None:
        """Stores the time at which bodies arrive, and the pressed buttons."""
        if topic is BODIES:
            self._bodies_at = self._clock()
        elif topic is CALLS and value.word in PRESSES:
            self._presses.append(PRESSES[value.word])


def _log_refusal(order: Possess | Release, answer: object) -> None:
    if not isinstance(answer, Done):
        log.warning("the edge refused the command %s: %s", order, getattr(answer, "reason", answer))
