"""An edge that scans the images it is given, and viewers that follow it over the wire."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

from patience import PATIENCE

from enliven.frames import DepthFrame, Frame
from enliven.possession import Actor
from enliven.wire import SCAN, Scan, ScanMessage
from enliven_edge.network.outlet import Outlet
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage import Stage
from enliven_edge.tracking import Tracker
from enliven_viewer.link import EdgeClient

LATER = 10**11
"""Nanoseconds by which the images of each showing are later than those of the one before."""
_BESIDE = 6.0
"""Times that an edge may take as long as its work takes alone: beside a suite on two cores."""


class Follower(Protocol):
    """What looks at the edge now and then."""

    def poll(self) -> Any:
        """Takes in what came."""


class Reel:
    """A sensor that shows what it is given."""

    name, fps, recorded = "reel", 30.0, True

    def read(self, timeout: float | None = None) -> Frame | None:
        raise TimeoutError


class ScanningEdge:
    """An edge that scans, and its viewers; ``followers`` are polled beside them."""

    def __init__(self, actors: Sequence[Actor] = ()) -> None:
        wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
        self.outlet = Outlet(wire, "reel")
        self.stage = Stage(actors)
        self.edge = Edge(Reel(), Tracker(), self.stage, self.outlet)
        self.viewers: list[EdgeClient] = []
        self.followers: list[Follower] = []
        self.answers: list[object] = []
        self._shown = 0

    def viewer(self) -> EdgeClient:
        """Returns another viewer, once the edge is heard."""
        self.viewers.append(EdgeClient([self.outlet.publisher.endpoint]))
        self.until(lambda: self.viewers[-1].status, "a viewer")
        return self.viewers[-1]

    def until(self, done: Callable[[], object], what: str) -> None:
        """Waits for something, while edge and viewers go on."""
        deadline, work = time.monotonic() + _BESIDE * PATIENCE, time.process_time() + PATIENCE
        while not done():
            # The edge is in this process: on a machine that has much else to do its work takes longer.
            late = time.process_time() > work or time.monotonic() > deadline
            assert not late, (
                f"{what}: it never came to be, after {self.said() if self.viewers else 'nothing'}"
            )
            self.edge._wait()
            self.edge._listen()
            self.poll()
            time.sleep(0.002)

    def poll(self) -> None:
        """Lets all viewers take in what came."""
        for one in (*self.viewers, *self.followers):
            one.poll()

    def ask(self, order: Scan) -> Any:
        """Gives an order as the first viewer, and returns the answer."""
        count = len(self.answers)
        self.viewers[0].ask(order, self.answers.append)
        self.until(lambda: len(self.answers) > count, order.do)
        return self.answers[-1]

    def said(self, viewer: int = 0) -> ScanMessage:
        """Returns how the scan goes, as a viewer was told."""
        return self.viewers[viewer].latest(SCAN).get("", ScanMessage())

    def show(self, frames: Sequence[DepthFrame], each: Callable[[], object] = bool) -> None:
        """Shows images to the sensor, later than all before, until the last was looked at or it is done.

        Args:
            each: what is done after each image.
        """
        self._shown += 1
        later = [replace(one, time_ns=one.time_ns + self._shown * LATER) for one in frames]
        for frame in later:
            self.edge.step(frame)
            self.poll()
            each()
        self.until(
            lambda: self.said().time_ns == later[-1].time_ns or self.said().phase == "done", "the last image"
        )

    def close(self) -> None:
        """Ends all."""
        self.edge.scans.close()
        for viewer in self.viewers:
            viewer.close()
        self.outlet.close()
