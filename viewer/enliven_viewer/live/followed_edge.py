"""Follows one of several edges, and merges the scenes of all edges."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from enliven.matching.match_list import MatchList
from enliven.wire import CAMERA, CameraMessage
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.link.placed_values import place_camera
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import Timeline
from enliven_viewer.render.scene import Scene
from enliven_viewer.settings import PlaybackSettings

PERFORMER_ID_OFFSET = 1_000_000
"""Offset between the performer ids of consecutive edges. An edge assigns fewer ids than this in months."""


def get_camera(client: EdgeClient) -> CameraMessage | None:
    """Returns the last camera message of an edge, or None if there is none."""
    client.take(CAMERA)  # Empty the queue. Only the newest camera message is used.
    return next(iter(client.latest(CAMERA).values()), None)


class FollowedEdge:
    """One edge, with its stage.

    Args:
        client: client with a connection to this edge only.
        number: number of the edge, 0 for the primary one.

    Attributes:
        number: number of the edge.
        client: the client.
        feed: the source of its messages. Its transform places the edge in the shared space.
        live: the edge's stage with its characters and performers.
    """

    def __init__(self, client: EdgeClient, number: int, settings: PlaybackSettings | None = None) -> None:
        self.client, self.number = client, number
        self.feed = EdgeFeed(client)
        self.live = LiveStage(self.feed, Document(Timeline(settings or PlaybackSettings())))

    @property
    def name(self) -> str:
        """Returns the name of the edge, or its address before the first message."""
        return self.client.edges[0].name

    @property
    def is_heard(self) -> bool:
        """Returns True if the edge's name is known from a received message."""
        return self.client.status is not None

    @property
    def connected(self) -> bool:
        """Returns True if messages arrive from the edge."""
        return self.live.document.edge.connected

    @property
    def camera(self) -> CameraMessage | None:
        """Returns the pose and the image of the edge's camera, or None if the edge does not send them."""
        camera = get_camera(self.client)
        transform = self.feed.transform
        return camera if camera is None or transform is None else place_camera(camera, transform)

    def receive(self, seconds: float) -> None:
        """Processes received messages, ``seconds`` after the last call."""
        self.live.receive(seconds)

    def close(self) -> None:
        """Closes the connection to the edge."""
        self.live.close()


def find_shared_performer_id(edge: int, performer: int) -> int:
    """Returns an id of a performer who is unique among all edges.

    Args:
        edge: number of the edge.
        performer: id of the performer on that edge.
    """
    return performer + PERFORMER_ID_OFFSET * edge


def split_performer_id(shared: int) -> tuple[int, int]:
    """Returns the number of the edge and the id on that edge: the inverse of
    :func:`find_shared_performer_id`."""
    return divmod(shared, PERFORMER_ID_OFFSET)


def merge_scenes(scene: Scene, guests: Iterable[FollowedEdge]) -> Scene:
    """Returns a scene merged with the live scenes of other edges.

    Each edge's performers get separate ids and colours.
    """
    actors, bodies, boards = list(scene.actors), list(scene.bodies), dict(scene.boards)
    for guest in guests:
        if not guest.connected:
            continue
        guest_scene = guest.live.scene
        actors += guest_scene.actors
        bodies += [
            replace(body, id=find_shared_performer_id(guest.number, body.id)) for body in guest_scene.bodies
        ]
        boards |= {name: _renumber_board(board, guest.number) for name, board in guest_scene.boards.items()}
    return replace(scene, actors=tuple(actors), bodies=tuple(bodies), boards=boards)


def _renumber_board(board: MatchList, edge: int) -> MatchList:
    """Returns a match list of another edge with its performer ids replaced by shared ids."""

    def renumber(performer: int) -> int:
        return find_shared_performer_id(edge, performer) if performer >= 0 else performer

    rows = tuple(replace(row, body=renumber(row.body)) for row in board.rows)
    return replace(board, body=renumber(board.body), rows=rows)
