"""Tests from key presses to attached nodes and back: an edge, a link and a viewer app over real sockets."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator

import numpy as np
import pytest
from patience import TIMEOUT_S
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.frames import BodyFrame, Frame
from enliven.person.body import Body
from enliven.possession import ActorSettings, EmbeddedActor
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.render.scene import make_scene

STEP = 33_333_333


class TwoPeople(Sensor):
    """An endless sensor of two people, one inside and one next to the mesh."""

    name = "two people"

    def __init__(self) -> None:
        posture = Posture(
            np.array([0.0, 1.0, -2.5]),
            standing_pose(arm_forward=0.1, elbow=1.5),
            model.lengths_for_height(1.75),
        )
        self._joints, self._count = posture.joints(), 0

    def read(self, timeout: float | None = None) -> Frame | None:
        self._count += 1
        people = [Body(k, self._joints.copy(), np.ones(20), stature=1.75) for k in (1, 2)]
        people[1].joints[:, 0] += 0.05
        return BodyFrame(people, self._count * STEP, self.name)

    def close(self) -> None: ...


class House:
    """An edge and a viewer without a window, which advance in turn."""

    def __init__(self, outlet: Outlet) -> None:
        mesh = make_chair(0.05)
        graph = DeformationGraph.build(mesh, nodes=48, seed=0)
        self.actor = EmbeddedActor(character_from_graph(mesh, graph, "chair"), graph, ActorSettings(fade=0.1))
        outlet.introduce(self.actor.character)
        self.edge = Edge(TwoPeople(), Tracker(), Stage([self.actor]), outlet)
        self.document = Document()
        self.feed = EdgeFeed(EdgeClient([outlet.publisher.endpoint]))
        self.live = LiveStage(self.feed, self.document)

    def step(self) -> None:
        frame = self.edge.sensor.read()
        assert frame is not None
        self.edge.step(frame)
        self.edge.poll_requests()
        self.feed.poll(self.document)
        self.live.scene = make_scene(self.document, self.live.playhead.moment(), self.live.style)
        time.sleep(0.002)

    def until(self, done) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < deadline, "it never came to be"
            self.step()

    @property
    def cues(self):
        moment = self.document.timeline.find_moment(self.document.timeline.end_ns)
        return moment.cues.get("chair") if moment else None

    @property
    def holders(self) -> dict[int, list[str]]:
        return {hold.body: [grip.parts for grip in hold.attachments] for hold in self.actor.holds}


@pytest.fixture
def house() -> Iterator[House]:
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "two people") as outlet:
        opened = House(outlet)
        opened.until(
            lambda: opened.cues and opened.document.characters and len(opened.live.scene.bodies) == 2
        )
        yield opened
        opened.feed.close()


def test_two_performers_attach_their_parts_by_keys(house: House) -> None:
    assert house.cues.state == "preview" and not house.cues.attached_mask.any()
    house.live.choose_parts(2)
    whole = set(house.cues.nodes)
    house.until(lambda: set(house.cues.nodes) < whole)
    shown = dict(zip(house.cues.nodes.tolist(), house.cues.strengths.tolist(), strict=True))
    house.live.possess()
    house.until(lambda: house.cues.state == "possessed" and house.cues.held)
    assert house.holders == {1: ["legs"]}
    strengths = house.actor.holds[0].strengths(48)
    held = {int(n): strengths[n] for n in np.flatnonzero(strengths)}
    assert held.keys() == shown.keys() and all(abs(held[n] - shown[n]) < 1 / 255 for n in held)
    house.until(lambda: len(house.live.scene.bodies) == 2)
    house.live.choose_performer()
    house.live.choose_performer()
    words = house.live.possession.describe_choice(int)
    assert words == "Press P to step in with the legs of performer 2"
    house.live.choose_parts(1)
    house.live.possess("join")
    house.until(lambda: set(house.cues.owners[house.cues.attached_mask].tolist()) == {1, 2})
    assert house.holders == {1: ["legs"], 2: ["upper body"]}
    house.live.choose_parts(8)
    house.live.possess("extend")
    house.until(lambda: len(house.holders[2]) == 2 or house.holders[2] == ["head"])
    house.live.release()
    house.until(lambda: house.holders == {1: ["legs"]})
    house.live.possession.body = None
    house.live.release()
    house.until(lambda: house.holders == {})


def test_smoothing_reaches_the_edge_and_refused_lock_is_not_shown(house: House) -> None:
    house.live.choose_performer()
    house.live.change_smoothing(1)
    house.until(lambda: house.edge.tracker.output.smoothing_amount(1) == 2.0)
    assert house.edge.tracker.output.smoothing_amount(2) == 1.0
    house.live.toggle_lock()
    house.until(lambda: "only the performers of one depth sensor" in house.document.edge.message)
    assert not house.live.possession.locked


def test_key_locks_and_unlocks_tracked_people(house: House) -> None:
    """The sensor delivers nothing, so only requests are processed, as between two depth frames."""
    house.edge.tracker = Tracker()  # no frame has been read yet
    tracker, silent = (
        house.edge.tracker,
        lambda: (house.edge.poll_requests(), house.feed.poll(house.document)),
    )
    for wanted, ids in ((True, frozenset()), (False, None)):
        house.live.toggle_lock()
        deadline = time.monotonic() + TIMEOUT_S
        while house.live.possession.locked != wanted and time.monotonic() < deadline:
            silent()
        assert house.live.possession.locked == wanted and tracker.locked_ids == ids


def test_refused_possession_is_reported(house: House) -> None:
    house.live.possession.body = 9
    house.live.possess()
    house.until(lambda: "performer 9 is not in view" in house.document.edge.message)
