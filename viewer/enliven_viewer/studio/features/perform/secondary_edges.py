"""Secondary edges. Their performers are shown and recorded in addition to those of the primary edge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from enliven.wire import CALLS, Topic
from enliven_viewer.language import tr
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.live.followed_edge import FollowedEdge
from enliven_viewer.settings import PlaybackSettings
from enliven_viewer.studio.features.perform.recorder import LiveRecorder


class SecondaryEdge(FollowedEdge):
    """A secondary edge, which is shown and recorded in addition to the primary edge.

    Its characters are called "edge/name", so that two chairs have different ids.

    Args:
        address: HOST or HOST:PORT.
        number: number of the secondary edge, from 1.
        prefix: returns the prefix of its characters' ids, given the edge's name.

    Attributes:
        recorder: receives all messages from this edge.

    Raises:
        InputError: if the address is invalid.
    """

    def __init__(
        self,
        address: str,
        number: int,
        settings: PlaybackSettings | None = None,
        prefix: Callable[[str], str] = lambda edge: edge,
    ) -> None:
        super().__init__(
            EdgeClient([address], "enliven window", prefixed=True, prefix=prefix), number, settings
        )
        self.address = address
        self.client.edges[0].align_clock()
        self.feed.on_message, self.feed.restarted = self._record, self._handle_restart
        self.recorder = LiveRecorder()

    @property
    def performers(self) -> tuple[int, ...]:
        """Returns the edge's own ids of its performers."""
        return tuple(sorted(body.id for body in self.live.scene.bodies)) if self.connected else ()

    @property
    def present(self) -> tuple[str, ...]:
        """Returns its performers and characters, one line each."""
        numbers = self.live.numbers
        people = (tr("Performer {0} at {1}", numbers.number_of(body), self.name) for body in self.performers)
        return (*people, *self.client.characters)

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
        """Processes received messages, and makes the edge's scene."""
        self.receive(seconds)
        self.live.compose(seconds)

    def receive(self, seconds: float) -> None:
        """Processes received messages."""
        holders = self.recorder.holders.current_holders
        self.live.held, self.live.holding = (
            {holder.character for holder in holders},
            {holder.body for holder in holders},
        )
        super().receive(seconds)

    def _record(self, topic: Topic, value: Any) -> None:
        if topic is not CALLS:
            self.recorder.record(topic, value)

    def _handle_restart(self) -> None:
        self.recorder.handle_restart()
