"""Performances through the real edge: swaying performers, their requests, and the recording."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path

from sample_meshes.chair import make_chair
from swaying import STEP_NS, swaying

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph, graph_from_character
from enliven.errors import InputError
from enliven.frames import BodyFrame, Frame
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.wire import Order
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker


class Performers(Sensor):
    """A sensor of tracked bodies: two performers, each in view in the frames given by ``seen``."""

    name, fps = "performers", 30.0

    def __init__(self, seen: Sequence[set[int]], seed: int = 0, away: float = 0.0) -> None:
        self._seen, self._seed, self._away, self._next = seen, seed, away, 0

    def read(self, timeout: float | None = None) -> Frame | None:
        number = self._next
        self._next += 1
        if number >= len(self._seen):
            return None
        bodies = [
            swaying(who, number, self._seed, (0.05 * who, -self._away)) for who in sorted(self._seen[number])
        ]
        return BodyFrame(bodies, 5_000_000_000 + number * STEP_NS, self.name)


def chair_actor(settings: ActorSettings, nodes: int = 48, name: str = "chair") -> EmbeddedActor:
    """Returns an actor of a coarse chair, as the edge creates it."""
    mesh = make_chair(0.05)
    character = character_from_graph(mesh, DeformationGraph.build(mesh, nodes), name)
    return EmbeddedActor(character, graph_from_character(character), settings)


def record_performance(
    path: Path,
    seen: Sequence[set[int]],
    orders: Mapping[int, Sequence[Order]],
    actors: Sequence[EmbeddedActor],
    seed: int = 0,
    away: float = 2.5,
) -> list[InputError]:
    """Records a performance and returns the refusals. Each request in ``orders`` is sent after the frame with
    its number.
    """
    wire, refused = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0), list[InputError]()
    with Outlet(wire, "performers", record=path) as outlet:
        edge = Edge(Performers(seen, seed, away), Tracker(), Stage(actors), outlet)
        for number in range(len(seen)):
            frame = edge.sensor.read()
            assert frame is not None
            edge.step(frame)
            for order in orders.get(number, ()):
                try:
                    edge.carry_out(order)
                except InputError as error:
                    refused.append(error)
    return refused
