"""Secondary edges in addition to the primary one. Their performers are shown and recorded too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from enliven.matching import MatchList
from enliven.wire import CALLS, CAMERA, CameraMessage, Topic
from enliven_viewer.language import tr
from enliven_viewer.link import EdgeClient, EdgeFeed
from enliven_viewer.live import LiveStage
from enliven_viewer.playback import Document, Timeline
from enliven_viewer.render import Scene
from enliven_viewer.settings import PlaybackSettings
from enliven_viewer.studio.perform.recorder import LiveRecorder

PERFORMER_ID_OFFSET = 100
"""Offset between the performer ids of one edge and the next. An edge tracks fewer at a time."""


def get_camera(client: EdgeClient) -> CameraMessage | None:
    """Returns the last camera message of an edge; None if there is none."""
    client.take(CAMERA)
    return next(iter(client.latest(CAMERA).values()), None)


class SecondaryEdge:
    """A secondary edge, which is shown and recorded in addition to the primary one.

    Its characters are called "edge/name", so that two chairs have different ids.

    Args:
        address: HOST or HOST:PORT.
        number: number of the secondary edge, from 1.

    Attributes:
        live: the followed stage.
        recorder: receives everything that arrives from it.

    Raises:
        InputError: if the address is invalid.
    """

    def __init__(self, address: str, number: int, settings: PlaybackSettings | None = None) -> None:
        self.address, self.number = address, number
        self._client = EdgeClient([address], "enliven window", prefixed=True)
        feed = EdgeFeed(self._client)
        feed.on_message, feed.restarted = self._record, self._handle_restart
        self.recorder = LiveRecorder()
        self.live = LiveStage(feed, Document(Timeline(settings or PlaybackSettings())))

    @property
    def name(self) -> str:
        """Returns the name of the edge, or its address before the first message."""
        return self._client.edges[0].name

    @property
    def connected(self) -> bool:
        """Returns True if messages arrive from it."""
        return self.live.document.edge.connected

    @property
    def performers(self) -> tuple[int, ...]:
        """Returns the ids of its performers, as assigned by that edge."""
        return tuple(sorted(body.id for body in self.live.scene.bodies)) if self.connected else ()

    @property
    def present(self) -> tuple[str, ...]:
        """Returns its performers and characters, one line each."""
        numbers = self.live.numbers
        people = (tr("Performer {0} at {1}", numbers.number_of(body), self.name) for body in self.performers)
        return (*people, *self._client.characters)

    @property
    def camera(self) -> CameraMessage | None:
        """Returns the position and the image of its camera; None if it does not send them."""
        return get_camera(self._client)

    @property
    def delay_ns(self) -> int:
        """Returns the measured latency in nanoseconds from a performer's movement to its arrival here.

        Returns 0 if unknown.
        """
        edge = self.live.document.edge
        if edge.sensor_to_pose_ms is None:
            return 0
        return round(1e6 * (edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)))

    def advance(self, seconds: float) -> None:
        """Processes received messages."""
        holders = self.recorder.holders.now
        self.live.held, self.live.holding = (
            {holder.character for holder in holders},
            {holder.body for holder in holders},
        )
        self.live.advance(seconds)

    def close(self) -> None:
        """Closes the connection to the edge."""
        self.live.close()

    def _record(self, topic: Topic, value: Any) -> None:
        if topic is not CALLS:
            self.recorder.record(topic, value)

    def _handle_restart(self) -> None:
        self.recorder.restarted()


def merge_scenes(scene: Scene, guests: Sequence[SecondaryEdge]) -> Scene:
    """Returns a scene merged with the live scenes of other edges.

    Each edge's performers get separate ids and colours.
    """
    actors, bodies, boards = list(scene.actors), list(scene.bodies), dict(scene.boards)
    for guest in guests:
        if not guest.connected:
            continue
        there = guest.live.scene
        actors += there.actors
        bodies += [replace(body, id=body.id + PERFORMER_ID_OFFSET * guest.number) for body in there.bodies]
        boards |= {
            name: _renumber_board(board, PERFORMER_ID_OFFSET * guest.number)
            for name, board in there.boards.items()
        }
    return replace(scene, actors=tuple(actors), bodies=tuple(bodies), boards=boards)


def _renumber_board(board: MatchList, ids: int) -> MatchList:
    """Returns a match list of another edge, with ``ids`` added to the known ids of its performers."""
    rows = tuple(replace(row, body=row.body + ids) if row.body >= 0 else row for row in board.rows)
    return replace(board, body=board.body + ids if board.body >= 0 else -1, rows=rows)
