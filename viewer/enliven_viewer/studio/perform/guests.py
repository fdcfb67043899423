"""Other edges beside the one that is led: who performs there is seen, and recorded with everything else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from enliven.matching import Board
from enliven.wire import CALLS, CAMERA, CameraMessage, Topic
from enliven_viewer.language import tr
from enliven_viewer.link import EdgeClient, EdgeFeed
from enliven_viewer.live import LiveStage
from enliven_viewer.playback import Document, Timeline
from enliven_viewer.render import Scene
from enliven_viewer.settings import PlaybackSettings
from enliven_viewer.studio.perform.recorder import LiveRecorder

APART = 100
"""Ids from the performers of one edge to those of the next: an edge follows fewer at a time."""


def camera_of(client: EdgeClient) -> CameraMessage | None:
    """What an edge told last of its camera; None if it has not."""
    client.take(CAMERA)
    return next(iter(client.latest(CAMERA).values()), None)


class Guest:
    """An edge that is seen and recorded beside another one.

    What stands there is called "edge/name", so that two chairs are two.

    Args:
        address: HOST or HOST:PORT.
        number: which of the guests it is, from 1.

    Attributes:
        live: what is followed of it.
        recorder: hears everything that arrives from it.

    Raises:
        InputError: if that is no address.
    """

    def __init__(self, address: str, number: int, settings: PlaybackSettings | None = None) -> None:
        self.address, self.number = address, number
        self._client = EdgeClient([address], "enliven window", prefixed=True)
        feed = EdgeFeed(self._client)
        feed.heard, feed.restarted = self._heard, self._began_again
        self.recorder = LiveRecorder()
        self.live = LiveStage(feed, Document(Timeline(settings or PlaybackSettings())))

    @property
    def name(self) -> str:
        """Returns the name of the edge, or its address before it was heard."""
        return self._client.edges[0].name

    @property
    def connected(self) -> bool:
        """Returns True if it is heard."""
        return self.live.document.edge.connected

    @property
    def performers(self) -> tuple[int, ...]:
        """Returns the ids of the performers there, as that edge has them."""
        return tuple(sorted(body.id for body in self.live.scene.bodies)) if self.connected else ()

    @property
    def present(self) -> tuple[str, ...]:
        """What is there, a line each."""
        numbers = self.live.numbers
        people = (tr("Performer {0} at {1}", numbers.number_of(body), self.name) for body in self.performers)
        return (*people, *self._client.characters)

    @property
    def camera(self) -> CameraMessage | None:
        """Returns where its camera stands and what it sees; None if it does not tell."""
        return camera_of(self._client)

    @property
    def delay_ns(self) -> int:
        """Returns nanoseconds from a performer's movement until it is here, as measured; 0 if it is not
        known.
        """
        edge = self.live.document.edge
        if edge.sensor_to_pose_ms is None:
            return 0
        return round(1e6 * (edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)))

    def advance(self, seconds: float) -> None:
        """Takes in what has arrived."""
        now = self.recorder.holders.now
        self.live.held, self.live.holding = {one.character for one in now}, {one.body for one in now}
        self.live.advance(seconds)

    def close(self) -> None:
        """Lets the edge go."""
        self.live.close()

    def _heard(self, topic: Topic, value: Any) -> None:
        if topic is not CALLS:
            self.recorder.heard(topic, value)

    def _began_again(self) -> None:
        self.recorder.restarted()


def together(scene: Scene, guests: Sequence[Guest]) -> Scene:
    """Returns a scene with what is live on other edges; performers of each have ids, and colours, of their
    own.
    """
    actors, bodies, boards = list(scene.actors), list(scene.bodies), dict(scene.boards)
    for guest in guests:
        if not guest.connected:
            continue
        there = guest.live.scene
        actors += there.actors
        bodies += [replace(body, id=body.id + APART * guest.number) for body in there.bodies]
        boards |= {name: _carried(board, APART * guest.number) for name, board in there.boards.items()}
    return replace(scene, actors=tuple(actors), bodies=tuple(bodies), boards=boards)


def _carried(board: Board, ids: int) -> Board:
    """Returns a board of another edge; its performers' ids, where they are known, are ``ids`` higher here."""
    rows = tuple(replace(row, body=row.body + ids) if row.body >= 0 else row for row in board.rows)
    return replace(board, body=board.body + ids if board.body >= 0 else -1, rows=rows)
