"""Tests of a puppet over sockets and as processes: performers move it, viewers solve it, takes store it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
from edge_session import ViewedSession, open_outlet
from PIL import Image
from sample_meshes.cactus_puppet import cactus_project

from enliven.document.character import Character, Pose
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.recording import Recording
from enliven.wire.characters import CharacterMessage
from enliven.wire.convert import message_to_pose
from enliven.wire.convert_characters import message_to_character
from enliven.wire.posecode import PoseCodec
from enliven.wire.streams import PoseMessage
from enliven_edge.network.outlet import Outlet
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.puppet.settings import PuppetSettings
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.playback.timeline import Timeline
from enliven_viewer.render.scene import make_scene

sys.path.insert(0, str(Path(__file__).parents[1] / "edge" / "puppets"))

from people_for_puppets import person

PROJECT = cactus_project(0.05)
PUPPET = PROJECT.puppet("cactus")
NAMES = [point.name for point in PUPPET.points]
LEFT, RIGHT = (1 + NAMES.index(name) for name in ("left hand", "right hand"))


class CactusSession(ViewedSession):
    """An edge with the cactus and two people with arms at given heights, and a viewer."""

    def __init__(self, outlet: Outlet) -> None:
        self.actor = PuppetActor(PROJECT, PUPPET, PuppetSettings(fade=0.1))
        self.actor.warm_up()
        self.left, self.right = 0.0, 0.0
        super().__init__(
            outlet, [self.actor], lambda: [person(left=self.left), person(id=2, x=1.5, right=self.right)]
        )

    @property
    def vertices(self) -> np.ndarray | None:
        """Returns the (V, 3) surface that the viewer shows, metres."""
        actors = self.live.scene.actors
        return actors[0].vertices if actors else None

    def hand(self, point: int) -> float:
        """Returns the surface's height at a control point, metres."""
        return float(self.vertices[PUPPET.points[point - 1].vertex, 1])


@pytest.fixture
def session() -> Iterator[CactusSession]:
    with open_outlet() as outlet, CactusSession(outlet) as opened:
        opened.until(lambda: opened.vertices is not None)
        yield opened


def test_viewer_solves_the_performers_puppet(session: CactusSession) -> None:
    assert session.document.characters["cactus"].kind == "points"
    session.live.possess()
    session.until(lambda: session.live.scene.actors[0].cues.state == "possessed")
    session.until(lambda: session.hand(LEFT) < 0.5)
    session.left = 2.7
    session.until(lambda: session.hand(LEFT) > 1.05)
    assert session.hand(RIGHT) < 0.5
    cues = session.live.scene.actors[0].cues
    assert len(cues.nodes) == len(NAMES)
    assert set(cues.owners.tolist()) == {1}


def test_second_performer_joins_with_parts_and_releases(session: CactusSession) -> None:
    session.live.possess()
    session.until(lambda: session.live.scene.actors[0].cues.state == "possessed")
    session.live.possession.body, session.live.possession.parts = 2, "right arm"
    session.live.possess("join")
    session.until(lambda: set(session.live.scene.actors[0].cues.owners.tolist()) == {1, 2})
    session.right = 2.7
    session.until(lambda: session.hand(RIGHT) > 1.05 and session.hand(LEFT) < 0.5)
    session.live.release()
    session.until(lambda: [hold.body for hold in session.actor.holds] == [1])
    session.live.possession.parts = "left foot"
    session.live.possess()
    session.until(lambda: "no control point of the puppet follows" in session.document.edge.message)


def test_late_viewer_sees_the_moving_puppet(session: CactusSession) -> None:
    session.live.possess()
    session.left = 2.7
    session.until(lambda: session.hand(LEFT) > 1.05)
    late, surfaces = Document(), SolvedSurfaces(wait=True)
    feed = EdgeFeed(EdgeClient([session.outlet.publisher.endpoint]))

    def hand() -> float:
        """Returns the height of the left hand in the late viewer, metres."""
        feed.poll(late)
        if not (late.characters and len(late.timeline)):
            return 0.0
        (actor,) = make_scene(
            late, late.timeline.find_moment(late.timeline.end_ns), session.live.style, surfaces
        ).actors
        return 0.0 if actor.vertices is None else float(actor.vertices[PUPPET.points[LEFT - 1].vertex, 1])

    session.until(lambda: hand() > 1.05)
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


@pytest.mark.slow
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
@pytest.mark.slow
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
