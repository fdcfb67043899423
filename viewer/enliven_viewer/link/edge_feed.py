"""A feed that puts the received messages of an edge onto a document's timeline."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from enliven.arrays import Float
from enliven.wire import BODIES, CALLS, CUES, POSE, Done, Look, Order, Topic, messages_to_health
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.frame_clock import FrameClock
from enliven_viewer.link.placed_values import place_value
from enliven_viewer.link.received_data import ReceivedBodies, ReceivedPose
from enliven_viewer.link.topic_tracks import find_track, list_shown_topics
from enliven_viewer.playback.document import Document, EdgeState

_NOTICE_S = 5.0
"""Seconds for which a notice is shown: long enough to read two lines."""
_NO_CHARACTERS_TIMEOUT_S = 3.0
"""Seconds without characters after which a wrong control port is suspected. Fetching characters takes less
time.
"""
_RECEIVING_STATES = ("connected", "on rate", "ended")
_LATENCY_SMOOTHING = 0.1
"""Smoothing factor of the displayed latency, which would flicker otherwise."""


class EdgeFeed:
    """A ``Feed`` that reads from an ``EdgeClient`` of one edge.

    Attributes:
        link: the client that holds the sockets.
        on_message: called with the topic and value of every message, in timeline order.
        restarted: called when another process of the edge is detected, before its messages.
        transform: (4, 4) rigid transform from the edge's world to the displayed world; None for the identity.
        frame_clock: converts times of the edge's sensor to this machine's clock.
    """

    def __init__(self, link: EdgeClient) -> None:
        self.link = link
        self.on_message: Callable[[Topic, Any], None] = lambda topic, value: None
        self.restarted: Callable[[], None] = lambda: None
        self.transform: Float | None = None
        self.frame_clock = FrameClock()
        self._shown_cues: set[str] = set()
        self._notice, self._notice_until = "", 0.0
        self._edge_ms: float | None = None
        self._link_ms: float | None = None
        self._lacks_characters_since: float | None = None
        self._look: Look | None = None
        self._known_instance: int | None = None
        self._instance: int | None = None

    def poll(self, document: Document) -> int:
        """Applies all received messages without waiting. Returns their number."""
        self.link.poll()
        began_again = self._watch_instance()
        document.characters = dict(self.link.characters)
        arrived_values = [(topic, value) for topic in list_shown_topics() for value in self.link.take(topic)]
        if not began_again:
            # Sort by time only if the edge did not restart: after a restart, the messages may contain times
            # of two sensor clocks.
            arrived_values.sort(key=lambda arrival: _time_ns(arrival[1]))
        for topic, received in arrived_values:
            self._add_times(received)
            value = received if self.transform is None else place_value(received, self.transform)
            find_track(topic).put(document, value)
            self.on_message(topic, value)
        for call in self.link.take(CALLS):
            self.on_message(CALLS, call)
        self._forget_cues(document)
        poses = [value for topic, value in arrived_values if topic is POSE]
        if poses:
            self._update_latency(poses[-1])
        self._resend_view()
        document.edge = self._state()
        return len(arrived_values)

    def newest_local_ns(self, document: Document) -> int | None:
        """Returns the time of the newest frame on this machine's monotonic clock, or None if it
        is not known.
        """
        probe = self.link.edges[0].probe
        if probe is None or not probe.is_known or not self.frame_clock.is_known or not len(document.timeline):
            return None
        return self.frame_clock.local_ns(document.timeline.end_ns, probe.offset_ns())

    def ask(self, order: Order, then: Callable[[], None] | None = None) -> None:
        """Sends an order to the edge. A viewing direction is sent again after the edge restarts."""
        if isinstance(order, Look):
            self._look = order
        self.link.ask(order, lambda answer: then() if then and isinstance(answer, Done) else None)

    def close(self) -> None:
        """Closes the sockets."""
        self.link.close()

    def _add_times(self, received: Any) -> None:
        """Adds the sensor time and the edge's wall-clock time of a frame to the clock conversion."""
        if isinstance(received, ReceivedPose):
            self.frame_clock.add(received.pose.time_ns, received.captured_ns)
        elif isinstance(received, ReceivedBodies):
            self.frame_clock.add(received.time_ns, received.captured_ns)

    def _watch_instance(self) -> bool:
        """Detects a restart of the edge and reports it. Returns True after a restart."""
        old_instance, self._instance = self._instance, self.link.edges[0].instance
        began_again = old_instance not in (None, self._instance)
        if began_again:
            self.frame_clock = FrameClock()
            self.restarted()
        return began_again

    def _forget_cues(self, document: Document) -> None:
        """Removes the cues of characters that the edge no longer has."""
        current = self.link.latest(CUES)
        for name in self._shown_cues - current.keys():
            document.forget_cues(name)
        self._shown_cues = set(current)

    def _resend_view(self) -> None:
        """Sends the viewing direction again to a restarted edge."""
        instance = self.link.edges[0].instance
        if instance != self._known_instance and self.link.status is not None:
            self._known_instance = instance
            if self._look is not None:
                self.link.ask(self._look)

    def _lacks_characters(self, connected: bool, now: float) -> bool:
        """Returns True if the edge is connected but has not sent characters for a while.

        A wrong port is a common reason.
        """
        if not connected or self.link.characters:
            self._lacks_characters_since = None
            return False
        self._lacks_characters_since = self._lacks_characters_since or now
        return now - self._lacks_characters_since > _NO_CHARACTERS_TIMEOUT_S

    def _update_latency(self, newest: ReceivedPose) -> None:
        edge, total_delay = newest.sensor_to_pose_ms, newest.age_ms()
        link_delay = max(total_delay - edge, 0.0)
        self._edge_ms = (
            edge if self._edge_ms is None else self._edge_ms + _LATENCY_SMOOTHING * (edge - self._edge_ms)
        )
        self._link_ms = (
            link_delay
            if self._link_ms is None
            else self._link_ms + _LATENCY_SMOOTHING * (link_delay - self._link_ms)
        )

    def _state(self) -> EdgeState:
        """Returns the state of the connection and of the edge, for display."""
        endpoint, health = next(iter(self.link.health.items()))
        now = time.monotonic()
        for notice in self.link.take_notices():
            self._notice, self._notice_until = notice.text, now + _NOTICE_S
        status = self.link.status
        connected = health.state in _RECEIVING_STATES
        message = self._notice if now < self._notice_until else ""
        if not message and not connected and health.state != "waiting":
            message = health.text
        if not message and self._lacks_characters(connected, now):
            message = f"no characters arrive from port {endpoint.control_port}: check --control-port"
        return EdgeState(
            connected=connected,
            address=endpoint.stream_address,
            phase=status.phase if status is not None else "",
            message=message,
            sensor_to_pose_ms=self._edge_ms,
            pose_to_screen_ms=self._link_ms,
            health=tuple(messages_to_health(status.health)) if status is not None and connected else (),
            signal=self.link.topics[endpoint][(POSE if self.link.characters else BODIES).name].signal,
        )


def _time_ns(value: Any) -> int:
    """Returns a message's time on the sensor's clock, in nanoseconds."""
    return value.pose.time_ns if isinstance(value, ReceivedPose) else value.time_ns
