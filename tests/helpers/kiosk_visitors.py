"""An edge with the chair and other characters, and synthetic visitors that a test moves."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from enliven.frames import BodyFrame
from enliven.person import Body
from enliven.recording import Recording
from enliven.wire import Endpoint
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import EdgeSettings, WireSettings
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.motion.dance import START_Z_M, Choreography
from enliven_synthesis.motion.motion import place_figure

RATE_HZ = 30.0
"""Frames per second of the sensor."""


class SyntheticVisitor:
    """A visitor of any height that stands, walks or dances at a position set by the test.

    Args:
        number: the tracking id.
        place: position on the floor (x, z) in metres.
    """

    def __init__(self, number: int, place: tuple[float, float], height: float = 1.72) -> None:
        self.number, self.place, self.yaw = number, place, 0.0
        self._performer = Performer(Proportions(height=height))
        self._height = height
        self.motion: Choreography = get_choreography("idle")
        self._began = 0.0

    def dance(self, name: str, now: float) -> None:
        """Begins a choreography."""
        self.motion, self._began = get_choreography(name), now

    def body(self, now: float) -> Body:
        """Returns the body at a time in seconds."""
        second = (now - self._began) % self.motion.duration
        figure = self._performer.pose(self.motion.posture(second))
        placed = place_figure(figure, (self.place[0], self.place[1] - START_Z_M), self.yaw)
        return Body(self.number, placed.joints, np.ones(20), stature=self._height)


class VisitorSensor(Sensor):
    """A sensor that returns the bodies of a test's visitors, in simulated time.

    Attributes:
        visitors: those in view.
        silent: True to deliver nothing, like a camera without power.
        now: seconds of the sensor's clock.
    """

    made_up = recorded = True

    def __init__(self) -> None:
        self.name, self.fps = "synthetic visitors", RATE_HZ
        self.visitors: list[SyntheticVisitor] = []
        self.silent = False
        self.now = 0.0

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """Returns the next frame."""
        self.now += 1.0 / RATE_HZ
        if self.silent:
            raise TimeoutError("no frame is due")
        bodies = [visitor.body(self.now) for visitor in self.visitors]
        return BodyFrame(bodies, round(self.now * 1e9), self.name)

    def close(self) -> None:
        """Does nothing, since there is no device."""


class RecordedVisitorSensor(VisitorSensor):
    """A sensor that replays the bodies of a recording once, from :meth:`restart` on.

    Args:
        path: the recording.

    Attributes:
        latest: the frame that was read last.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.latest = BodyFrame([], 0, self.name)
        self._frames = [frame for frame in Recording(path).frames() if isinstance(frame, BodyFrame)]
        self._began = -1e3

    def restart(self) -> None:
        """Begins the recording again."""
        self._began, self.silent = self.now, False

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """Returns the next frame of the recording."""
        frame = super().read(timeout)
        number = round((self.now - self._began) * RATE_HZ) - 1
        recorded = self._frames[number].bodies if number < len(self._frames) else []
        self.latest = BodyFrame([*frame.bodies, *recorded], frame.time_ns, self.name)
        return self.latest


class StagedKiosk:
    """A real edge that the test advances frame by frame.

    Args:
        characters: (name, mesh) of each character.
        sensor: the sensor; None makes one without a recording.
    """

    def __init__(
        self, *characters: tuple[str, str], name: str = "kiosk-test", sensor: VisitorSensor | None = None
    ) -> None:
        self.sensor = sensor or VisitorSensor()
        actors = [create_actor(mesh, 64, name=title) for title, mesh in characters]
        for actor in actors:
            actor.warm_up()
        settings = EdgeSettings(wire=WireSettings(name=name, port=0, control_port=0))
        self.outlet = Outlet(settings.wire, self.sensor.name)
        self.edge = Edge(self.sensor, Tracker(), Stage(actors), self.outlet)

    @property
    def endpoint(self) -> Endpoint:
        """Returns the address of the edge."""
        return self.outlet.publisher.endpoint

    @property
    def now(self) -> float:
        """Returns the time of the sensor's clock in seconds."""
        return self.sensor.now

    @property
    def holders(self) -> dict[str, list[int]]:
        """Returns the performer ids attached to each character."""
        return {name: [hold.body for hold in actor.holds] for name, actor in self.edge.stage.actors.items()}

    def step(self) -> None:
        """Processes one frame, and the requests that have arrived."""
        try:
            frame = self.sensor.read()
        except TimeoutError:
            frame = None
        if frame is not None:
            self.edge.step(frame)
        self.edge.poll_requests()
        time.sleep(0.002)  # lets the messages pass through the loopback interface

    def close(self) -> None:
        """Ends the edge and closes its sockets."""
        self.outlet.close()
