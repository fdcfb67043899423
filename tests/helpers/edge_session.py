"""A real edge in the test's own process, people whom the test chooses, and a viewer without a window."""

from __future__ import annotations

import contextlib
import uuid
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from patience import wait_until

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.possession import Actor
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.render.scene import make_scene

FRAME_NS = 33_333_333
"""Nanoseconds between two frames of the sensor."""


def local_wire(**options: Any) -> WireSettings:
    """Returns the settings of an edge with a unique name and free ports of this computer."""
    return WireSettings(**{"name": uuid.uuid4().hex[:12], "port": 0, "control_port": 0, **options})


@contextlib.contextmanager
def open_outlet() -> Iterator[Outlet]:
    """Yields the network connection of an edge."""
    with Outlet(local_wire(), GivenPeople.name) as outlet:
        yield outlet


class GivenPeople(Sensor):
    """A sensor that sees the people whom a function returns.

    Args:
        make_people: returns the people in the next frame.
    """

    name, fps = "people", 30.0

    def __init__(self, make_people: Callable[[], list[Body]]) -> None:
        self._make_people, self._count = make_people, 0

    def read(self, timeout: float | None = None) -> BodyFrame:
        """Returns the next frame."""
        self._count += 1
        return BodyFrame(self._make_people(), self._count * FRAME_NS, self.name)

    def close(self) -> None:
        """Does nothing."""


class EdgeSession:
    """An edge that advances by one frame in each call of :meth:`step`.

    Args:
        outlet: its network connection.
        actors: the characters on its stage.
        make_people: returns the people in the next frame.
        options: other arguments of :class:`enliven_edge.service.Edge`.
    """

    def __init__(
        self,
        outlet: Outlet,
        actors: Sequence[Actor],
        make_people: Callable[[], list[Body]],
        **options: Any,
    ) -> None:
        for actor in actors:
            outlet.introduce(actor.character)
        self.outlet, self.sensor = outlet, GivenPeople(make_people)
        self.edge = Edge(self.sensor, Tracker(), Stage(list(actors)), outlet, **options)

    def step(self) -> None:
        """Runs one frame, and answers requests."""
        self.edge.step(self.sensor.read())
        self.edge.poll_requests()

    def until(self, done: Callable[[], Any]) -> None:
        """Runs frames until a condition holds."""
        wait_until(done, step=self.step, interval=0.002)


class ViewedSession(EdgeSession):
    """An edge and a viewer without a window, which advance in turn."""

    def __init__(
        self,
        outlet: Outlet,
        actors: Sequence[Actor],
        make_people: Callable[[], list[Body]],
        **options: Any,
    ) -> None:
        super().__init__(outlet, actors, make_people, **options)
        self.document = Document()
        self.feed = EdgeFeed(EdgeClient([outlet.publisher.endpoint]))
        self.live, self._surfaces = LiveStage(self.feed, self.document), SolvedSurfaces()

    def step(self) -> None:
        """Runs one frame of the edge and one of the viewer."""
        super().step()
        self.feed.poll(self.document)
        moment, style = self.live.playhead.moment(), self.live.style
        self.live.scene = make_scene(self.document, moment, style, self._surfaces)

    def __enter__(self) -> ViewedSession:
        return self

    def __exit__(self, *error: object) -> None:
        self.feed.close()
