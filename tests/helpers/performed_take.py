"""Performances through the real edge: performers who sway, what they are told to do, and its recording."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from sample_meshes.chair import make_chair

from enliven.deformation.graph import DeformationGraph, character_from, graph_of
from enliven.errors import InputError
from enliven.frames import BodyFrame, Frame
from enliven.person import Body, Joint
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.possession.standing import standing_figure
from enliven.rotation import from_rotation_vector, rotate
from enliven.wire import Order
from enliven_edge.network import Outlet
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage import Stage
from enliven_edge.tracking import Tracker

STEP_NS = 33_333_333
_LIMBS = {
    Joint.KNEE_LEFT: (Joint.ANKLE_LEFT, Joint.FOOT_LEFT),
    Joint.ELBOW_LEFT: (Joint.WRIST_LEFT, Joint.HAND_LEFT),
    Joint.ELBOW_RIGHT: (Joint.WRIST_RIGHT, Joint.HAND_RIGHT),
}


def swaying(id: int, frame: int, seed: int = 0, place=(0.0, -2.5)) -> Body:
    """A performer who steps to and fro, bows and swings the limbs, a frame of 30 a second."""
    random, t = np.random.default_rng(seed + 7 * id), frame / 30
    joints = standing_figure(1.7 + 0.05 * id)
    for middle, ends in _LIMBS.items():
        turn = from_rotation_vector(0.6 * np.sin(3 * t + random.uniform(0, 6)) * random.normal(size=3))
        joints[list(ends)] = joints[middle] + rotate(turn, joints[list(ends)] - joints[middle])
    bow = from_rotation_vector(np.array([0.3 * np.sin(2 * t + random.uniform(0, 6)), 0.2 * np.sin(t), 0.0]))
    upper = [j for j in Joint if joints[j, 1] > joints[Joint.HIP_CENTER, 1]]
    joints[upper] = joints[Joint.HIP_CENTER] + rotate(bow, joints[upper] - joints[Joint.HIP_CENTER])
    joints[:, 0] += place[0] + 0.15 * np.sin(1.5 * t)
    joints[:, 2] += place[1] + 0.1 * np.sin(t + seed)
    return Body(id, joints, np.clip(1.0 + 0.3 * random.normal(size=20), 0.05, 1.0), stature=1.7 + 0.05 * id)


class Performers:
    """A sensor of tracked bodies: two performers, each in view where ``seen`` says so."""

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
    """A coarse chair as the edge casts it."""
    mesh = make_chair(0.05)
    character = character_from(mesh, DeformationGraph.build(mesh, nodes), name)
    return EmbeddedActor(character, graph_of(character), settings)


def perform(
    path: Path,
    seen: Sequence[set[int]],
    orders: Mapping[int, Sequence[Order]],
    actors: Sequence[EmbeddedActor],
    seed: int = 0,
    away: float = 2.5,
) -> list[InputError]:
    """Records a performance: ``orders`` are given after the frames of their numbers; returns refusals."""
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


def without_cache(project, name):
    """The project as after its solved motion was damaged: every stream of a character stands still."""
    shape = project.graph(name)
    parts = [replace(part, possession=replace(part.possession, solved="")) for part in shape.parts]
    streams = dict(project.streams)
    for part in parts:
        stream = streams[part.take]
        count = stream.positions.shape[1]
        still = np.zeros((1, count, 3)), np.tile(np.eye(3), (1, count, 1, 1))
        streams[part.take] = replace(stream, positions=still[0], linear=still[1])
    return replace(
        project,
        streams=streams,
        characters={**project.characters, name: shape.with_changes(parts=tuple(parts))},
    )
