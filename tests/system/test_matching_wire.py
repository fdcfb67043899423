"""Tests of finding matching poses over real sockets: a viewer browses the matches by keys and selects one."""

from __future__ import annotations

import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from patience import TIMEOUT_S

from enliven.frames import BodyFrame, Frame
from enliven_edge.network.outlet import Outlet
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.rig.rig_actor import RigActor
from enliven_edge.stage.rig.settings import MatchingSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.live.match_cards import make_cards
from enliven_viewer.playback.document import Document
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.overlay.match_lines import make_match_rows
from enliven_viewer.render.scene import make_scene
from enliven_viewer.settings import ViewerSettings

sys.path.insert(0, str(Path(__file__).parents[1] / "edge" / "matching"))

from rigs_for_stage import person, star

from enliven_edge.sensors.base import Sensor

STEP = 33_333_333


class Pointing(Sensor):
    """A sensor of one body with arms in given directions."""

    name = "pointing"

    def __init__(self) -> None:
        self.left, self.right, self._count = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), 0

    def read(self, timeout: float | None = None) -> Frame | None:
        self._count += 1
        return BodyFrame([person(self.left, self.right)], self._count * STEP, self.name)

    def close(self) -> None: ...


class House:
    """An edge with a star character, and a viewer without a window. They advance in turn."""

    def __init__(self, outlet: Outlet) -> None:
        self.actor = RigActor(star(), MatchingSettings(fade=0.1))
        outlet.introduce(self.actor.character)
        self.sensor = Pointing()
        self.edge = Edge(self.sensor, Tracker(), Stage([self.actor]), outlet)
        self.document = Document()
        self.feed = EdgeFeed(EdgeClient([outlet.publisher.endpoint]))
        self.live = LiveStage(self.feed, self.document)
        self.camera = OrbitCamera(ViewerSettings().render.opening)
        self.camera.face(0.0, 0.2)
        self.camera.advance(10.0)

    def step(self) -> None:
        frame = self.sensor.read()
        assert frame is not None
        self.edge.step(frame)
        self.edge.poll_requests()
        self.feed.poll(self.document)
        self.live.scene = make_scene(self.document, self.live.playhead.moment(), self.live.style)
        self.live.report_view(self.camera.view(1.0))
        time.sleep(0.002)

    def until(self, done) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < deadline, "it never came to be"
            self.step()

    @property
    def board(self):
        return self.live.scene.boards.get("star")

    @property
    def tips(self) -> list[str]:
        """Returns the limbs that the viewer highlights, identified by the positions of their tips."""
        names, joints = self.actor.live_shape.shape.skeleton.names, self.actor.live_shape.joints
        lines = self.board.rows[self.board.shown].lines
        return [names[int(np.linalg.norm(joints - line[-1], axis=1).argmin())][:-2] for line in lines]


@pytest.fixture
def house() -> Iterator[House]:
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "pointing") as outlet:
        opened = House(outlet)
        opened.until(lambda: opened.document.characters and opened.board is not None and opened.board.rows)
        yield opened
        opened.feed.close()


def test_viewer_shows_selects_and_accepts_matches(house: House) -> None:
    live, camera = house.live, house.camera
    live.choose_parts(3)  # the arms
    house.until(lambda: len(house.board.rows[0].lines) == 2)
    house.until(lambda: house.tips == ["left", "right"])
    cards = make_cards(live.scene, camera.view(1.6))
    assert len(cards) == 6 and [card.meant for card in cards].index(True) == house.board.shown
    assert all(card.bones.min() >= 0.0 and card.bones[..., 1].max() <= 1.0 for card in cards)
    rows, deep = make_match_rows(live.scene.boards)
    assert len(rows) == 2 * (2 + 3) and deep > 0.0
    house.sensor.left = (0.0, 1.0, 0.0)
    house.until(lambda: house.tips == ["up", "right"])
    live.show_other_match(1)
    house.until(lambda: house.board.shown == 1)
    second = house.tips
    live.possess()
    house.until(lambda: house.board.state == "playing")
    assert house.tips == second
    assert make_cards(live.scene, camera.view(1.6)) == ()
    before = house.actor.live_shape.joints
    house.sensor.right = (0.0, -1.0, 0.0)
    house.until(lambda: np.abs(house.actor.live_shape.joints - before).max() > 0.2)
    live.release()
    house.until(lambda: house.board.state == "choosing")


def test_edge_ranks_matches_for_the_viewing_direction(house: House) -> None:
    house.live.choose_parts(3)
    house.until(lambda: house.tips == ["left", "right"])
    house.camera.face(np.pi, 0.2)
    house.camera.advance(10.0)
    house.until(lambda: house.tips == ["right", "left"])


def test_the_camera_turns_to_where_the_bones_are_seen(house: House) -> None:
    house.camera.face(1.5, 0.2)
    house.camera.advance(10.0)
    house.live.show_bones(house.camera)
    house.camera.advance(10.0)
    forward = -house.camera.view(1.0).camera_from_world[2, :3]
    assert abs(forward[2]) > 0.75, "most limbs of the star lie across z"
