"""A real edge in the test's own process, and clients that connect by raw sockets."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Callable

import numpy as np
import trimesh
import zmq
from patience import wait_until
from zmq_contexts import make_context

from enliven.formats.project.one_character import character_bytes, project_of_mesh
from enliven.frames import BodyFrame
from enliven.keys.client import ClientKeys
from enliven.meshes import Mesh
from enliven.person.body import Body
from enliven.wire import requests, topics
from enliven.wire.envelope import pack_control, unpack_control
from enliven_edge.character_upload import CharacterUploads
from enliven_edge.network.access import Access
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import EdgeSettings, WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.stage_capacity import StageSettings
from enliven_edge.tracking.tracker import Tracker

FRAME_NS = 33_333_333
BOX = trimesh.creation.box((0.4, 0.5, 0.3))
BOX_MESH = Mesh(np.add(BOX.vertices, [0.0, 0.25, 0.0]), np.array(BOX.faces, np.int32))
BOX_DATA = character_bytes(project_of_mesh(BOX_MESH, "box"), "box")
"""A project of one small possessed mesh, as a client sends it."""


class NoSensor(Sensor):
    """A sensor without frames; the test provides them."""

    name, fps = "given", 30.0

    def read(self, timeout: float | None = None) -> None:
        return None


class ExposedEdge:
    """A real edge that runs one step in each call of :meth:`frame`."""

    def __init__(
        self,
        stage: StageSettings | None = None,
        rate: float = 10_000.0,
        access: Access | None = None,
        ports: tuple[int, int] = (0, 0),
    ) -> None:
        name, (port, control_port) = uuid.uuid4().hex[:12], ports
        wire = WireSettings(name=name, port=port, control_port=control_port, rate=rate, budget=50.0)
        self.stage = Stage([], stage)
        self.outlet = Outlet(wire, "given", access=access)
        self.settings = EdgeSettings(nodes=8, wire=wire)
        uploads = CharacterUploads(self.stage, self.settings)
        self.edge = Edge(NoSensor(), Tracker(), self.stage, self.outlet, uploads=uploads)
        self.time_ns = 0
        self.people: list[Body] = []
        self.visitors: list[Visitor] = []

    def frame(self) -> None:
        """Runs one frame of the edge with the current people in view."""
        self.time_ns += FRAME_NS
        self.edge.step(BodyFrame(self.people, self.time_ns, "given"))
        self.edge.poll_requests()

    def visitor(self, keys: ClientKeys | None = None) -> Visitor:
        """Opens a new connection to the control port."""
        self.visitors.append(Visitor(self, keys))
        return self.visitors[-1]

    def until(self, done: Callable[[], object], *polled: Callable[[], object]) -> None:
        """Runs frames until a condition holds."""

        def step() -> None:
            self.frame()
            for poll in polled:
                poll()

        wait_until(done, step=step, interval=0.0005)

    def close(self) -> None:
        for visitor in self.visitors:
            visitor.close()
        self.edge.scans.close()
        self.outlet.close()


class Visitor:
    """A client of the edge: a DEALER socket."""

    def __init__(self, exposed: ExposedEdge, keys: ClientKeys | None = None) -> None:
        self.exposed, self.number = exposed, 0
        self.context = make_context()
        self.socket = self.context.socket(zmq.DEALER)
        if keys is not None:
            keys.encrypt_socket(self.socket)
        self.socket.connect(exposed.outlet.publisher.endpoint.control_address)

    def ask(self, body: requests.Ask) -> requests.Answer:
        """Sends a request and runs the edge until it answers."""
        self.number += 1
        self.socket.send(pack_control(requests.Request(self.number, body)))
        self.exposed.until(lambda: self.socket.poll(0))
        reply = unpack_control(self.socket.recv(), topics.REPLY)
        assert reply.id == self.number
        return reply.body

    def announce(
        self, name: str, revision: int = 1, data: bytes = BOX_DATA
    ) -> tuple[requests.PutCharacter, requests.Answer]:
        """Announces a character; returns the request and its answer."""
        order = requests.PutCharacter(name, revision, hashlib.sha256(data).digest(), len(data))
        return order, self.ask(order)

    def put(self, name: str, revision: int = 1, data: bytes = BOX_DATA) -> requests.Answer:
        """Announces and sends a character. Returns ``Done`` when it is on the stage, otherwise the
        refusal.
        """
        order, answer = self.announce(name, revision, data)
        while isinstance(answer, requests.Awaited):
            if answer.received < len(data):
                part = data[answer.received : answer.received + 60_000]
                self.ask(requests.CharacterPart(name, order.digest, answer.received, part))
            answer = self.ask(order)
        return answer

    def close(self) -> None:
        self.context.destroy(linger=0)
