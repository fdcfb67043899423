"""An edge that scans the given images, and viewers that follow it over the network."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

from patience import TIMEOUT_S

from enliven.frames import DepthFrame, Frame
from enliven.possession import Actor
from enliven.wire import SCAN, Scan, ScanMessage
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient

LATER_NS = 10**11
"""Nanoseconds added to the images' times in each repetition, so that they are later than before."""
_SECOND_CAMERA_POSE = 6.0
"""Timeout as a multiple of the edge's working time on an idle machine, for a test suite on two cores."""


class Follower(Protocol):
    """An object that polls the edge."""

    def poll(self) -> Any:
        """Processes received messages."""


class FrameListSensor(Sensor):
    """A sensor that delivers the given frames."""

    name, fps, recorded = "reel", 30.0, True

    def read(self, timeout: float | None = None) -> Frame | None:
        raise TimeoutError


class ScanningEdge:
    """A scanning edge, and its viewers; ``followers`` are polled together with them."""

    def __init__(self, actors: Sequence[Actor] = ()) -> None:
        wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
        self.outlet = Outlet(wire, "reel")
        self.stage = Stage(actors)
        self.edge = Edge(FrameListSensor(), Tracker(), self.stage, self.outlet)
        self.viewers: list[EdgeClient] = []
        self.followers: list[Follower] = []
        self.answers: list[object] = []
        self._shown = 0

    def viewer(self) -> EdgeClient:
        """Returns another viewer, as soon as it receives from the edge."""
        self.viewers.append(EdgeClient([self.outlet.publisher.endpoint]))
        self.until(lambda: self.viewers[-1].status, "a viewer")
        return self.viewers[-1]

    def until(self, done: Callable[[], object], what: str) -> None:
        """Waits for a condition while edge and viewers run."""
        deadline, work = time.monotonic() + _SECOND_CAMERA_POSE * TIMEOUT_S, time.process_time() + TIMEOUT_S
        while not done():
            # The edge runs in this process, so its work takes longer on a busy machine.
            late = time.process_time() > work or time.monotonic() > deadline
            assert not late, (
                f"{what}: it never came to be, after {self.get_scan_message() if self.viewers else 'nothing'}"
            )
            self.edge._wait()
            self.edge.poll_requests()
            self.poll()
            time.sleep(0.002)

    def poll(self) -> None:
        """Lets all viewers process received messages."""
        for follower in (*self.viewers, *self.followers):
            follower.poll()

    def ask(self, order: Scan) -> Any:
        """Sends a request as the first viewer and returns the answer."""
        count = len(self.answers)
        self.viewers[0].ask(order, self.answers.append)
        self.until(lambda: len(self.answers) > count, order.do)
        return self.answers[-1]

    def get_scan_message(self, viewer: int = 0) -> ScanMessage:
        """Returns the state of the scan that a viewer has received."""
        return self.viewers[viewer].latest(SCAN).get("", ScanMessage())

    def feed_frames(self, frames: Sequence[DepthFrame], each: Callable[[], object] = bool) -> None:
        """Feeds images to the sensor until the last one is processed or the scan is done. Their times are
        later than all before.

        Args:
            each: called after each image.
        """
        self._shown += 1
        later = [replace(frame, time_ns=frame.time_ns + self._shown * LATER_NS) for frame in frames]
        for frame in later:
            self.edge.step(frame)
            self.poll()
            each()
        self.until(
            lambda: (
                self.get_scan_message().time_ns == later[-1].time_ns
                or self.get_scan_message().phase == "done"
            ),
            "the last image",
        )

    def close(self) -> None:
        """Closes the edge and all viewers."""
        self.edge.scans.close()
        for viewer in self.viewers:
            viewer.close()
        self.outlet.close()
