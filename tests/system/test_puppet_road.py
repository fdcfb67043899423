"""Tests of a puppet over sockets and as processes: performers move it, viewers solve it, takes store it."""

from __future__ import annotations

import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
from patience import TIMEOUT_S
from PIL import Image
from sample_meshes.cactus_puppet import cactus_project

from enliven.document.character import Character, Pose
from enliven.frames import BodyFrame, Frame
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.recording import Recording
from enliven.wire.characters import CharacterMessage
from enliven.wire.convert import message_to_pose
from enliven.wire.convert_characters import message_to_character
from enliven.wire.posecode import PoseCodec
from enliven.wire.streams import PoseMessage
from enliven_edge.network.outlet import Outlet
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.puppet.settings import PuppetSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.playback.timeline import Timeline
from enliven_viewer.render.scene import make_scene

sys.path.insert(0, str(Path(__file__).parents[1] / "edge" / "puppets"))

from people_for_puppets import FRAME, person

from enliven_edge.sensors.base import Sensor

PROJECT = cactus_project(0.05)
PUPPET = PROJECT.puppet("cactus")
NAMES = [point.name for point in PUPPET.points]
LEFT, RIGHT = (1 + NAMES.index(name) for name in ("left hand", "right hand"))


class Waving(Sensor):
    """A sensor of two people with left arms at given heights."""

    name = "waving"

    def __init__(self) -> None:
        self.left, self.right, self._count = 0.0, 0.0, 0

    def read(self, timeout: float | None = None) -> Frame | None:
        self._count += 1
        bodies = [person(left=self.left), person(id=2, x=1.5, right=self.right)]
        return BodyFrame(bodies, self._count * FRAME, self.name)

    def close(self) -> None: ...


class House:
    """An edge with the cactus and a viewer without a window, which advance in turn."""

    def __init__(self, outlet: Outlet) -> None:
        self.actor = PuppetActor(PROJECT, PUPPET, PuppetSettings(fade=0.1))
        self.actor.warm_up()
        outlet.introduce(self.actor.character)
        self.sensor = Waving()
        self.edge = Edge(self.sensor, Tracker(), Stage([self.actor]), outlet)
        self.document, self.outlet = Document(), outlet
        self.feed = EdgeFeed(EdgeClient([outlet.publisher.endpoint]))
        self.live, self.surfaces = LiveStage(self.feed, self.document), SolvedSurfaces()

    def step(self) -> None:
        frame = self.sensor.read()
        assert frame is not None
        self.edge.step(frame)
        self.edge.poll_requests()
        self.feed.poll(self.document)
        moment, style = self.live.playhead.moment(), self.live.style
        self.live.scene = make_scene(self.document, moment, style, self.surfaces)
        time.sleep(0.002)

    def until(self, done) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < deadline, "it never came to be"
            self.step()

    @property
    def vertices(self) -> np.ndarray | None:
        """Returns the (V, 3) surface that the viewer shows, metres."""
        actors = self.live.scene.actors
        return actors[0].vertices if actors else None

    def hand(self, point: int) -> float:
        """Returns the surface's height at a control point, metres."""
        return float(self.vertices[PUPPET.points[point - 1].vertex, 1])


@pytest.fixture
def house() -> Iterator[House]:
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "waving") as outlet:
        opened = House(outlet)
        opened.until(lambda: opened.vertices is not None)
        yield opened
        opened.feed.close()


def test_viewer_solves_the_performers_puppet(house: House) -> None:
    assert house.document.characters["cactus"].kind == "points"
    house.live.possess()
    house.until(lambda: house.live.scene.actors[0].cues.state == "possessed")
    house.until(lambda: house.hand(LEFT) < 0.5)
    house.sensor.left = 2.7
    house.until(lambda: house.hand(LEFT) > 1.05)
    assert house.hand(RIGHT) < 0.5
    cues = house.live.scene.actors[0].cues
    assert len(cues.nodes) == len(NAMES)
    assert set(cues.owners.tolist()) == {1}


def test_second_performer_joins_with_parts_and_releases(house: House) -> None:
    house.live.possess()
    house.until(lambda: house.live.scene.actors[0].cues.state == "possessed")
    house.live.possession.body, house.live.possession.parts = 2, "right arm"
    house.live.possess("join")
    house.until(lambda: set(house.live.scene.actors[0].cues.owners.tolist()) == {1, 2})
    house.sensor.right = 2.7
    house.until(lambda: house.hand(RIGHT) > 1.05 and house.hand(LEFT) < 0.5)
    house.live.release()
    house.until(lambda: [hold.body for hold in house.actor.holds] == [1])
    house.live.possession.parts = "left foot"
    house.live.possess()
    house.until(lambda: "no control point of the puppet follows" in house.document.edge.message)


def test_late_viewer_sees_the_moving_puppet(house: House) -> None:
    house.live.possess()
    house.sensor.left = 2.7
    house.until(lambda: house.hand(LEFT) > 1.05)
    late, surfaces = Document(), SolvedSurfaces(wait=True)
    feed = EdgeFeed(EdgeClient([house.outlet.publisher.endpoint]))

    def hand() -> float:
        """Returns the height of the left hand in the late viewer, metres."""
        feed.poll(late)
        if not (late.characters and len(late.timeline)):
            return 0.0
        (actor,) = make_scene(
            late, late.timeline.find_moment(late.timeline.end_ns), house.live.style, surfaces
        ).actors
        return 0.0 if actor.vertices is None else float(actor.vertices[PUPPET.points[LEFT - 1].vertex, 1])

    house.until(lambda: hand() > 1.05)
    feed.close()


@pytest.fixture(scope="module")
def road(tmp_path_factory) -> Path:
    """Returns the folder with film, sheet and take of the shipped cactus and recording."""
    folder = tmp_path_factory.mktemp("cactus")
    command = [sys.executable, "-m", "enliven", "run", "--mesh", "cactus", "--film", "--out", str(folder)]
    command += ["--possess-at", "0.5", "--seconds", "3", "--record", str(folder / "take.mcap")]
    command += ["--size", "640x360"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return folder


def taken(take: Path) -> tuple[Character, list[Pose], list[int]]:
    """Returns the character, its poses, and the size of each pose in bytes."""
    recording = Recording(take)
    (_, data), *_ = recording.messages("character")
    character = message_to_character(msgspec.msgpack.decode(data, type=CharacterMessage))
    codec, raw = PoseCodec(character), [data for _, data in recording.messages("pose")]
    poses = [message_to_pose(msgspec.msgpack.decode(message, type=PoseMessage), codec) for message in raw]
    return character, poses, [len(message) for message in raw]


@pytest.mark.system
def test_the_shipped_recording_drives_the_shipped_cactus(road: Path) -> None:
    character, poses, sizes = taken(road / "take.mcap")
    assert character.kind == "points"
    assert len(poses) == 90
    assert np.median(sizes) < 160
    local = np.array([(p.positions - p.positions[0]) @ p.linear[0] for p in poses])
    np.testing.assert_allclose(local[10], character.pivots, atol=1e-3)
    assert np.abs(local[60:] - character.pivots).max() > 0.4
    paces = np.linalg.norm(np.diff([p.positions for p in poses], axis=0), axis=2) * 30
    # The cactus moves to the performer when they appear, within a fifth of a second.
    assert paces[6:].max() < 5.0


@pytest.mark.system
def test_film_shows_the_moving_cactus(road: Path) -> None:
    sheet = np.asarray(Image.open(road / "enliven.png").convert("RGB")).astype(int)
    green = (sheet[..., 1] > sheet[..., 0] + 40) & (sheet[..., 1] > sheet[..., 2] + 30)
    # The performer is in the image from the first frame on, so the cactus fills less of it.
    assert green.mean() > 0.0095
    assert (road / "enliven.mp4").stat().st_size > 20_000


@pytest.mark.system
@pytest.mark.slow
def test_take_plays_back_unchanged_and_opens_in_the_studio(road: Path) -> None:
    character, poses, _ = taken(road / "take.mcap")
    document, surfaces = Document(Timeline(bounded=False)), SolvedSurfaces(wait=True)
    feed = TakeFeed(road / "take.mcap")
    while feed.poll(document):
        pass
    held = np.asarray(character.held)
    for pose in poses[40::12]:
        (actor,) = make_scene(
            document, document.timeline.find_moment(pose.time_ns), LiveStage(feed, document).style, surfaces
        ).actors
        assert actor.vertices is not None
        np.testing.assert_allclose(actor.vertices[held], pose.positions[1:], atol=2e-3)
    project = read_possessed(road / "take.mcap")
    assert len(project.graphs) == 1
    assert next(iter(project.streams.values())).positions.shape[0] >= 89
